//! Names, sizes and layout of a model as one text of plain data.

use partita_analysis::mobility::Mobility;
use partita_math::spatial::Mat3;
use partita_model::joint::Motion;
use partita_model::rows::Owner;
use partita_model::spec::JointKind;
use partita_model::Model;
use partita_system::prelude::*;
use serde::Serialize;

#[derive(Serialize)]
struct Summary<'m> {
    name: &'m str,
    planar: bool,
    nq: usize,
    nv: usize,
    rows: usize,
    rank: Option<usize>,
    mobility: Option<usize>,
    joint_rows: Option<usize>,
    joint_rank: Option<usize>,
    bodies: Vec<Body<'m>>,
    joints: Vec<Joint<'m>>,
    couplings: Vec<Coupling<'m>>,
    drives: Vec<&'m str>,
    /// Joints that events may part.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    parting: Vec<&'m str>,
    /// The row of each drive.
    drive_rows: Vec<usize>,
    /// Rows of loop closures, which come first.
    closing_rows: usize,
    coordinates: &'m [String],
    velocities: &'m [String],
    rows_names: Vec<&'m str>,
    removed: Vec<Removed<'m>>,
    /// The largest change of a joint frame that makes it movable, or would.
    geometric_error: f64,
    /// The change that was made.
    repaired: f64,
    notes: Vec<String>,
}

#[derive(Serialize)]
struct Body<'m> {
    name: &'m str,
}

/// First index and number.
type Span = [usize; 2];

#[derive(Serialize)]
struct Joint<'m> {
    name: &'m str,
    kind: JointKind,
    parent: &'m str,
    child: &'m str,
    tree: bool,
    /// Among the coordinates and velocities of all joints.
    q: Span,
    v: Span,
    /// In the state; none for a joint that closes a loop.
    state_q: Option<Span>,
    state_v: Option<Span>,
    /// Axes of the drawing on the child, where a spatial rotation refers to others.
    drawn: Option<[[f64; 3]; 3]>,
    axes: Vec<&'m str>,
}

#[derive(Serialize)]
struct Coupling<'m> {
    name: &'m str,
    word: &'m str,
    /// Rows of its multipliers.
    rows: Vec<usize>,
}

#[derive(Serialize)]
struct Removed<'m> {
    row: &'m str,
    why: &'m str,
}

/// The summary of a model with the properties of its assembled zero position.
pub fn summary(m: &Model, mobility: Option<&Mobility>, note: Option<&str>) -> serde_json::Result<String> {
    let size = m.size();
    let of_drawing = mobility.and_then(|x| x.of_drawing(m.spec.drawing_tolerance));
    let redundant = mobility.map_or(&[][..], |x| &x.redundant);
    let summary = Summary {
        name: &m.spec.name,
        planar: m.is_planar(),
        nq: size.nq,
        nv: size.nv,
        rows: size.rows,
        rank: mobility.map(|x| size.nv - x.mobility),
        mobility: mobility.map(|x| x.mobility),
        joint_rows: mobility.map(|x| x.joint_rows),
        joint_rank: mobility.map(|x| x.joint_rank),
        bodies: m.spec.bodies.iter().map(|b| Body { name: &b.name }).collect(),
        joints: joints(m),
        couplings: couplings(m),
        drives: m.drives().iter().map(|d| d.name.as_str()).collect(),
        parting: m.spec.parting.keys().map(String::as_str).collect(),
        drive_rows: m.drives().iter().map(|d| d.row).collect(),
        closing_rows: m.closing_rows,
        coordinates: &m.zero_position().coordinate_names,
        velocities: &m.zero_position().velocity_names,
        rows_names: m.row_names.iter().map(|row| row.name.as_str()).collect(),
        removed: redundant.iter().map(|x| Removed { row: &x.row, why: &x.why }).collect(),
        geometric_error: mobility.map_or(0.0, |x| x.geometric_error),
        repaired: m.geometry().geometric_error(),
        notes: note.map(str::to_string).into_iter().chain(of_drawing).collect(),
    };
    serde_json::to_string(&summary)
}

fn couplings(m: &Model) -> Vec<Coupling<'_>> {
    let rows = |i: usize| {
        let own = m.row_names.iter().enumerate().filter(|(_, r)| r.owner == Owner::Coupling(i));
        own.map(|(row, _)| row).collect()
    };
    let all = m.spec.couplings.iter().enumerate();
    all.map(|(i, c)| Coupling { name: c.name(), word: c.word(), rows: rows(i) }).collect()
}

fn joints(m: &Model) -> Vec<Joint<'_>> {
    let (mut first_q, mut first_v) = (0, 0);
    let mut found = Vec::with_capacity(m.spec.joints.len());
    for (p, j) in m.zero_position().joints.iter().zip(&m.spec.joints) {
        let nq: usize = p.shape.motions.iter().map(|x| x.coordinates()).sum();
        let nv = p.shape.dof();
        let first = p.in_state().map(|l| &m.zero_position().links[l[0]]);
        let turns = p.shape.motions.contains(&Motion::Ball) && p.on_child.0 != Mat3::<f64>::identity().0;
        let mut axes: Vec<&str> = Vec::with_capacity(nv);
        for (motion, name) in p.shape.motions.iter().zip(&p.shape.names) {
            match motion {
                Motion::Ball => axes.extend(["wx", "wy", "wz"]),
                _ => axes.push(name),
            }
        }
        found.push(Joint {
            name: &j.name,
            kind: j.kind,
            parent: &j.parent,
            child: &j.child,
            tree: p.links.is_some(),
            q: [first_q, nq],
            v: [first_v, nv],
            state_q: first.map(|l| [l.q, nq]),
            state_v: first.map(|l| [l.v, nv]),
            drawn: first.filter(|_| turns).map(|_| p.on_child.0),
            axes,
        });
        first_q += nq;
        first_v += nv;
    }
    found
}
