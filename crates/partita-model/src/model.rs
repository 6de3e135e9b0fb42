//! The compiled mechanism: immutable, a [`ConstrainedSystem`](partita_system::ConstrainedSystem).

use crate::compile::{self, RowName};
use crate::error::DescriptionError;
use crate::load::{self, Load};
use crate::place::{Coordinates, Placed};
use crate::spec::{Force, Spec, Value};
use crate::tree::{LinkMotion, Tree, TreeScratch};
use crate::validate;
use crate::value::Functions;
use partita_math::elimination::Pattern;
use partita_math::spatial::{Planar, Space, Spatial, Vec3};
use partita_system::SystemError;
use std::sync::Arc;

/// A prescribed coordinate: the row `q_i − f(t)`.
#[derive(Clone, Debug)]
pub struct DriveRow {
    /// Name of the drive.
    pub name: String,
    /// Driven joint.
    pub joint: usize,
    /// Which of its velocities.
    pub coordinate: usize,
    /// Coordinate.
    pub q: usize,
    /// Velocity.
    pub v: usize,
    /// Motion.
    pub motion: Value,
    /// Row.
    pub row: usize,
}

/// The tree in the space the evaluations run in.
#[derive(Clone, Debug)]
pub(crate) enum Engine {
    /// All motions in one plane: three numbers a twist.
    Flat(Tree<Planar<f64>>),
    /// Six.
    Full,
}

/// Memory of the evaluations of a model.
pub struct ModelScratch {
    pub(crate) flat: Option<TreeScratch<Planar<f64>>>,
    pub(crate) full: TreeScratch<Spatial<f64>>,
    dense: Dense,
    forces_at: bool,
}

#[derive(Default)]
struct Dense {
    mass: Vec<f64>,
    h: Vec<f64>,
    work: Vec<f64>,
}

/// A compiled mechanism.
pub struct Model {
    /// The description it was made from.
    pub spec: Spec,
    /// Zero position.
    pub placed: Placed,
    pub(crate) engine: Engine,
    /// The tree in space; outputs and reactions are computed with it.
    pub full: Tree<Spatial<f64>>,
    /// Applied loads.
    pub loads: Vec<Load>,
    /// Prescribed motions.
    pub drives: Vec<DriveRow>,
    /// Closing rows.
    pub row_names: Vec<RowName>,
    /// Rows of the spatial closings that the plane makes superfluous.
    pub out_of_plane: Vec<RowName>,
    pub(crate) functions: Arc<dyn Functions>,
    pattern: Pattern,
    has_power: bool,
    dense_projection: bool,
    coordinates: Coordinates,
    /// Reference points of the links in the zero position.
    pub(crate) reference: Vec<Vec3<f64>>,
    /// Velocity whose integral each coordinate is, if there is one.
    velocity_of: Vec<Option<usize>>,
    /// Coordinates that each velocity changes.
    coordinates_of: Vec<std::ops::Range<usize>>,
    /// Angles that nothing counts the turns of.
    turns: Vec<bool>,
    /// Large move of each velocity.
    reach: Vec<f64>,
    /// What a large move can open each row by.
    row_reach: Vec<f64>,
    /// Rows that close directions.
    row_is_angle: Vec<bool>,
    /// Nodes at the ends of each spring, and where the first end is in the zero position.
    pub(crate) spring_nodes: Vec<(usize, usize, Vec3<f64>)>,
}

/// Run `$body` with `$tree` and `$s` bound to the tree and scratch of the engine.
macro_rules! with_engine {
    ($self:expr, $scratch:expr, |$tree:ident, $s:ident| $body:expr) => {
        match (&$self.engine, &mut $scratch.flat) {
            (Engine::Flat($tree), Some($s)) => $body,
            _ => {
                let ($tree, $s) = (&$self.full, &mut $scratch.full);
                $body
            }
        }
    };
}

mod system; // below the macro, which it uses

impl Model {
    /// Compile a description; `functions` are those it names by number.
    pub fn new(spec: Spec, functions: Arc<dyn Functions>, coordinates: Coordinates) -> Result<Self, DescriptionError> {
        Self::build(spec, functions, coordinates, true)
    }

    /// The same mechanism with all rows of its closings in space, also when it is planar: for questions about the
    /// reactions out of the plane.
    pub fn in_space(&self) -> Result<Self, DescriptionError> {
        Self::build(self.spec.clone(), self.functions.clone(), self.coordinates, false)
    }

    fn build(
        spec: Spec,
        functions: Arc<dyn Functions>,
        coordinates: Coordinates,
        allow_plane: bool,
    ) -> Result<Self, DescriptionError> {
        validate::validate(&spec, functions.count())?;
        let placed = Placed::new(&spec, coordinates, allow_plane)?;
        if placed.nv == 0 {
            let message = "nothing can move: every body is fixed to the ground; free a joint";
            return Err(DescriptionError::new("mechanism", &spec.name, message));
        }
        let (full, full_rows) = compile::compile::<Spatial<f64>>(&spec, &placed)?;
        let loads = Load::all(&spec, &placed)?;
        let (engine, row_names, mut columns) = if placed.planar {
            let (flat, rows) = compile::compile::<Planar<f64>>(&spec, &placed)?;
            let columns = compile::columns(&flat);
            (Engine::Flat(flat), rows, columns)
        } else {
            (Engine::Full, full_rows.clone(), compile::columns(&full))
        };
        let out_of_plane = if placed.planar {
            full_rows.iter().filter(|r| !row_names.iter().any(|k| k.name == r.name)).cloned().collect()
        } else {
            Vec::new()
        };
        let mut drives = Vec::new();
        for d in &spec.drives {
            let (q, v) = load::tree_coordinate(&spec, &placed, "drive", &d.name, &d.joint, d.coordinate)?;
            let q = q.ok_or_else(|| {
                DescriptionError::new(
                    "drive",
                    &d.name,
                    "a turn in space has no single coordinate to drive; drive joints with one axis in its place",
                )
            })?;
            if drives.iter().any(|x: &DriveRow| x.v == v) {
                return Err(DescriptionError::new("drive", &d.name, format!("joint \"{}\" is driven twice", d.joint)));
            }
            drives.push(DriveRow {
                name: d.name.clone(),
                joint: load::joint_index(&spec, &d.joint),
                coordinate: d.coordinate,
                q,
                v,
                motion: d.motion.clone(),
                row: columns.len(),
            });
            columns.push(vec![v]);
        }
        let has_power = loads.iter().any(Load::is_dissipative) || full.springs.iter().any(|s| s.damping != 0.0);
        let pattern = Pattern::from_rows(placed.nv, &columns);
        let nodes = validate::nodes(&spec)?;
        let spring_nodes = spec
            .forces
            .iter()
            .filter_map(|f| match f {
                Force::Spring { body1, point1, body2, .. } => {
                    let a = nodes[body1.as_str()];
                    Some((a, nodes[body2.as_str()], compile::point_on(&placed, a, *point1).1))
                }
                _ => None,
            })
            .collect();
        let reference = compile::reference_points(&placed);
        let mut velocity_of = vec![None; placed.nq];
        let mut turns = vec![false; placed.nq];
        let mut coordinates_of = vec![0..0; placed.nv];
        let mut reach = vec![1.0; placed.nv];
        for l in full.links.iter().skip(1) {
            match l.motion {
                LinkMotion::Ball => coordinates_of[l.v..l.v + 3].fill(l.q..l.q + 4),
                LinkMotion::Turn(_) => {
                    coordinates_of[l.v] = l.q..l.q + 1;
                    velocity_of[l.q] = Some(l.v);
                    turns[l.q] = true;
                }
                LinkMotion::Slide(_) => {
                    velocity_of[l.q] = Some(l.v);
                    coordinates_of[l.v] = l.q..l.q + 1;
                    reach[l.v] = placed.length;
                }
            }
        }
        if loads.iter().any(Load::sees_coordinates) {
            turns.fill(false);
        }
        for q in loads.iter().filter_map(Load::counted).chain(drives.iter().map(|d| d.q)) {
            turns[q] = false;
        }
        let mut row_reach = match &engine {
            Engine::Flat(tree) => closing_reaches(tree, &placed),
            Engine::Full => closing_reaches(&full, &placed),
        };
        row_reach.extend(drives.iter().map(|d| reach[d.v]));
        let turned = |l: &crate::tree::Link<Spatial<f64>>, v| l.v == v && matches!(l.motion, LinkMotion::Turn(_));
        let mut row_is_angle = match &engine {
            Engine::Flat(tree) => closing_angles(tree),
            Engine::Full => closing_angles(&full),
        };
        row_is_angle.extend(drives.iter().map(|d| full.links.iter().skip(1).any(|l| turned(l, d.v))));
        let mut model = Self {
            reference,
            spring_nodes,
            velocity_of,
            coordinates_of,
            turns,
            reach,
            row_reach,
            row_is_angle,
            coordinates,
            dense_projection: false,
            spec,
            placed,
            engine,
            full,
            loads,
            drives,
            row_names,
            out_of_plane,
            functions,
            pattern,
            has_power,
        };
        model.dense_projection = model.dense_is_cheaper();
        Ok(model)
    }

    /// For k near n the mass matrix is cheaper than k partial velocities: compare the two counts.
    fn dense_is_cheaper(&self) -> bool {
        let n = self.placed.nv;
        let k = n.saturating_sub(self.pattern.rows);
        let links = self.full.links.len();
        // a partial velocity: a cross product and its share of the sums for M_d, per link and pair of columns
        let partial = links * (k * k * 6 + 24 * k);
        // a column of M touches what it carries; then D M Dᵀ
        let carried: usize = (1..links).map(|i| self.depth(i)).sum();
        let dense = carried * 60 + n * n * k.min(n) / 2;
        dense < partial
    }

    fn depth(&self, mut i: usize) -> usize {
        let mut d = 0;
        while i != 0 {
            i = self.full.links[i].parent;
            d += 1;
        }
        d
    }

    /// Which coordinates the tree is made of.
    pub fn coordinates(&self) -> Coordinates {
        self.coordinates
    }

    /// All motions in one plane?
    pub fn is_planar(&self) -> bool {
        self.placed.planar
    }

    /// Coordinates of the drawing: zero, and unit quaternions.
    pub fn initial(&self) -> Vec<f64> {
        let mut q = vec![0.0; self.placed.nq];
        for l in self.full.links.iter().skip(1) {
            if matches!(l.motion, LinkMotion::Ball) {
                q[l.q] = 1.0;
            }
        }
        q
    }

    /// Joint of a row: a closing or a drive.
    pub fn joint_of_row(&self, row: usize) -> usize {
        match self.row_names.get(row) {
            Some(r) => r.joint,
            None => self.drives[row - self.row_names.len()].joint,
        }
    }

    fn forces(&self, t: f64, q: &[f64], v: &[f64], s: &mut ModelScratch) -> Result<(), SystemError> {
        if s.forces_at {
            return Ok(());
        }
        with_engine!(self, s, |tree, x| {
            tree.clear_forces(x);
            tree.spring_forces(x);
            tree.apply_loads(&self.loads, &self.placed.basis, &*self.functions, t, q, v, x)?;
        });
        s.forces_at = true;
        Ok(())
    }

    /// Kinetic and potential energy at the last `velocity`.
    pub fn energy(&self, t: f64, q: &[f64], v: &[f64], s: &ModelScratch) -> Result<(f64, f64), SystemError> {
        let (kinetic, gravity, springs, loads) = match (&self.engine, &s.flat) {
            (Engine::Flat(tree), Some(x)) => {
                let (k, g) = tree.energy(x);
                let l = tree.load_energy(&self.loads, &self.placed.basis, &*self.functions, t, q, v, x)?;
                (k, g, tree.spring_energy(x).0, l.0)
            }
            _ => {
                let (tree, x) = (&self.full, &s.full);
                let (k, g) = tree.energy(x);
                let l = tree.load_energy(&self.loads, &self.placed.basis, &*self.functions, t, q, v, x)?;
                (k, g, tree.spring_energy(x).0, l.0)
            }
        };
        Ok((kinetic, gravity + springs + loads))
    }

    fn mass_error(&self, at: (usize, f64)) -> SystemError {
        SystemError::Mass { name: self.placed.velocity_names[at.0].clone(), pivot: at.1 }
    }
}

/// What a large move can open each closing row by: 1 for turns; for displacements the longest lever arm between the
/// closing point and the joints of its loop, or the characteristic length where something slides.
fn closing_reaches<G: Space>(tree: &Tree<G>, placed: &Placed) -> Vec<f64> {
    let mut reaches = Vec::with_capacity(tree.rows);
    for k in &tree.closings {
        let p = &placed.joints[k.joint];
        let mut length = 1e-6 * placed.size;
        for path in &k.path {
            let point = if path.on_b { p.child_point } else { p.parent_point };
            length = match tree.links[path.link].motion {
                LinkMotion::Slide(_) => placed.length,
                _ => length.max((point - placed.links[path.link].point).norm()),
            }
            .max(length);
        }
        reaches.extend((0..k.rows()).map(|i| if i < k.slide_rows() { length } else { 1.0 }));
    }
    reaches
}

/// Which closing rows are turns.
fn closing_angles<G: Space>(tree: &Tree<G>) -> Vec<bool> {
    tree.closings.iter().flat_map(|k| (0..k.rows()).map(|i| i >= k.slide_rows())).collect()
}

/// Axis helper for outputs: a length of the engine's space as three numbers.
pub(crate) fn three<G: Space>(x: G::Vec) -> Vec3<f64> {
    Vec3(G::vec_to(x))
}
