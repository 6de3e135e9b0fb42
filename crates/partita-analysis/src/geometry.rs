//! The mechanism in space without its masses.
//!
//! Mobility, redundancy and self-stresses are matters of geometry. They are evaluated for a system in which every
//! velocity has unit mass in its characteristic displacement (a radian for rotations, the size of the mechanism for
//! translations). So they are defined for bodies without mass or axial inertia too, and do not depend on the masses.
//!
//! Rows are measured against the loop they close. One that no motion of the loop changes (the rotation about an axis of
//! the plane, in a loop of parallel axes) consists of rounding errors alone in a tilted drawing; without a scale it
//! would count as an independent condition.

use crate::error::AnalysisError;
use partita_math::elimination::Pattern;
use partita_math::spatial::{Quaternion, Vec3};
use partita_math::tolerance;
use partita_model::model::ModelScratch;
use partita_model::tree::LinkMotion;
use partita_model::Model;
use partita_system::clusters::Clusters;
use partita_system::start::Start;
use partita_system::system::structure::{Row, Velocity};
use partita_system::system::{Guards, Levels, Manifold, Methods, Metric, Structure, Tangent, Varied};
use partita_system::{Size, SystemError};

/// Least size of a loop. Unit: size of the mechanism. Reason: a loop that shrinks to a point still has a size to
/// compare rounding with.
const LEAST_LOOP: f64 = 1e-6;

/// The mechanism with all closing rows in space, and its coordinates there.
///
/// Joint coordinates are the same in the plane and in space. Bodies that float in the plane (absolute coordinates) have
/// two translations and a rotation there, three translations and a quaternion in space.
pub(crate) fn in_space(model: &Model, q: &[f64]) -> Result<(Model, Vec<f64>), AnalysisError> {
    let twin = model.in_space_at(q)?;
    let lifted = lifted(model, &twin, q);
    Ok((twin, lifted))
}

/// The coordinates in space of the `twin` that [`Model::in_space`] made.
pub(crate) fn lifted(model: &Model, twin: &Model, q: &[f64]) -> Vec<f64> {
    if twin.size().nq == model.size().nq {
        return q.to_vec();
    }
    let mut lifted = twin.initial();
    let out = model.zero_position().basis;
    for (planar, body) in model.zero_position().bodies.iter().zip(&twin.zero_position().bodies) {
        let (turn, ball) = (model.zero_position().links[planar.link].q, twin.zero_position().links[body.link].q);
        let shift = out.apply_transposed(Vec3([q[turn - 2], q[turn - 1], 0.0]));
        let rotation = Quaternion::exp(out.apply_transposed(Vec3([0.0, 0.0, q[turn]])));
        lifted[ball - 3..ball].copy_from_slice(&shift.0);
        lifted[ball..ball + 4].copy_from_slice(&rotation.0);
    }
    lifted
}

/// The closing rows of a model, with or without its drives, and unit masses over squared characteristic displacements.
pub(crate) struct Geometry<'m> {
    /// The mechanism.
    pub(crate) model: &'m Model,
    /// That of the mechanism with these rows and sizes.
    structure: Structure,
    /// Its rows as rows of the mechanism.
    rows: Vec<usize>,
    /// `s_i² = [M⁻¹]_ii`: the square of the characteristic displacement of velocity i.
    scale2: Vec<f64>,
    /// Weight below which a row is round-off.
    nothing: f64,
}

/// Scratch memory: that of the model, and of the rows left out.
pub(crate) struct GeometryScratch {
    model: ModelScratch,
    phi: Vec<f64>,
    c: Vec<f64>,
    a: Vec<f64>,
}

impl<'m> Geometry<'m> {
    /// All rows if `drives`, otherwise those of the loop closures alone.
    pub(crate) fn new(model: &'m Model, drives: bool) -> Self {
        let all = model.pattern();
        let rows: Vec<usize> = if drives { (0..all.rows).collect() } else { model.undriven().collect() };
        let columns: Vec<Vec<usize>> = rows.iter().map(|&i| all.col_idx[all.row(i)].to_vec()).collect();
        let pattern = Pattern::from_rows(all.cols, &columns);
        let holonomic = rows.iter().filter(|&&i| i < model.size().holonomic).count();
        let mut scale2 = vec![1.0; model.size().nv];
        for l in model.equations().full.links.iter().skip(1) {
            if matches!(l.motion, LinkMotion::Slide(_)) {
                scale2[l.v] = model.length().powi(2);
            }
        }
        let mut row_displacement = Vec::with_capacity(model.pattern().rows);
        for k in &model.equations().full.closings {
            let point = model.zero_position().joints[k.joint].child_point;
            let length = k.path.iter().fold(LEAST_LOOP * model.extent(), |m: f64, p| {
                match model.equations().full.links[p.link].motion {
                    LinkMotion::Slide(_) => model.length(),
                    _ => m.max((point - model.zero_position().links[p.link].point).norm()),
                }
            });
            row_displacement.extend((0..k.rows()).map(|i| if i < k.slide_rows() { length } else { 1.0 }));
        }
        // conditions other than loop closures define their own scale; 0 if unknown
        row_displacement
            .extend((model.closing_rows..all.rows).map(|i| model.structure().rows[i].displacement.unwrap_or(0.0)));
        let all = model.structure();
        let row = |&i: &usize| Row { displacement: Some(row_displacement[i]), ..all.rows[i].clone() };
        let velocity = |(v, s2): (&Velocity, &f64)| Velocity { displacement: s2.sqrt(), ..v.clone() };
        let structure = Structure {
            size: Size { rows: rows.len(), holonomic, ..all.size },
            clusters: Clusters::one(pattern.cols, pattern.rows),
            pattern,
            coordinates: all.coordinates.clone(),
            velocities: all.velocities.iter().zip(&scale2).map(velocity).collect(),
            rows: rows.iter().map(row).collect(),
            rheonomic: all.rheonomic,
            has_power: false,
            lacks_mass: false,
            given_count: 0,
            drawing: all.drawing.clone(),
        };
        // weak conditions of a drawing are not round-off
        let nothing = if model.geometry().weak { tolerance::LOST_PIVOT } else { tolerance::REDUNDANT };
        Self { model, structure, rows, scale2, nothing }
    }

    /// The rows of `twin` that can work against each other in reactions of `model`: drives belong to them, actuators do
    /// not.
    pub(crate) fn of_reactions(model: &Model, twin: &'m Model) -> Self {
        Self::new(twin, !model.is_actuated())
    }

    /// Length of row `i` of C for unit characteristic displacements over the closure error of a large displacement:
    /// squared, 1 for a well-scaled row.
    fn weight(&self, i: usize, c: &[f64]) -> f64 {
        let Structure { pattern, rows, .. } = &self.structure;
        let Some(large) = rows[i].displacement.filter(|x| *x != 0.0) else { return 1.0 };
        let square = |e: usize| c[e].powi(2) * self.scale2[pattern.col_idx[e]];
        pattern.row(i).map(square).sum::<f64>() / large.powi(2)
    }

    /// Squared sine or [`weight`](Self::weight) of the weakest accepted row: how far the position is from a singular
    /// one.
    pub(crate) fn distance(&self, start: &Start, t: f64, q: &[f64]) -> Result<f64, SystemError> {
        let c = self.jacobian(t, q)?;
        let kept = (0..self.structure.pattern.rows).filter(|i| start.dropped.binary_search(i).is_err());
        Ok(kept.fold(start.smallest, |m, i| m.min(self.weight(i, &c))))
    }

    /// Values of C; rows that are round-off are zero.
    pub(crate) fn jacobian(&self, t: f64, q: &[f64]) -> Result<Vec<f64>, SystemError> {
        self.jacobian_with(&[], t, q)
    }

    /// Values of C, those of the `dropped` rows as they are: a row may be a small multiple of one that is kept.
    pub(crate) fn jacobian_with(&self, dropped: &[usize], t: f64, q: &[f64]) -> Result<Vec<f64>, SystemError> {
        let rows = self.structure.pattern.rows;
        let (mut phi, mut c, mut a) = (vec![0.0; rows], vec![0.0; self.structure.pattern.nnz()], vec![0.0; rows]);
        let mut s = self.scratch();
        self.position(t, q, &mut s, &mut phi, &mut c, &mut a)?;
        self.restore(dropped, &s, &mut c);
        Ok(c)
    }

    /// Write the `dropped` rows into C as they are at the position just evaluated.
    pub(crate) fn restore(&self, dropped: &[usize], s: &GeometryScratch, c: &mut [f64]) {
        let all = self.model.pattern();
        dropped.iter().for_each(|&i| c[self.structure.pattern.row(i)].copy_from_slice(&s.c[all.row(self.rows[i])]));
    }

    /// Row `i` as a row of the mechanism.
    pub(crate) fn row_of_model(&self, i: usize) -> usize {
        self.rows[i]
    }

    /// Characteristic displacements of all velocities.
    pub(crate) fn scales(&self) -> Vec<f64> {
        self.scale2.iter().map(|s2| s2.sqrt()).collect()
    }
}

impl Levels for Geometry<'_> {
    type Scratch = GeometryScratch;
    fn structure(&self) -> &Structure {
        &self.structure
    }
    fn scratch(&self) -> GeometryScratch {
        let all = self.model.pattern();
        GeometryScratch {
            model: self.model.scratch(),
            phi: vec![0.0; all.rows],
            c: vec![0.0; all.nnz()],
            a: vec![0.0; all.rows],
        }
    }
    fn position(
        &self,
        t: f64,
        q: &[f64],
        s: &mut GeometryScratch,
        phi: &mut [f64],
        c: &mut [f64],
        a: &mut [f64],
    ) -> Result<(), SystemError> {
        self.model.position(t, q, &mut s.model, &mut s.phi, &mut s.c, &mut s.a)?;
        let all = self.model.pattern();
        for (i, &row) in self.rows.iter().enumerate() {
            if i < phi.len() {
                phi[i] = s.phi[row];
            }
            a[i] = s.a[row];
            c[self.structure.pattern.row(i)].copy_from_slice(&s.c[all.row(row)]);
        }
        for i in 0..self.structure.pattern.rows {
            if self.weight(i, c) < self.nothing {
                c[self.structure.pattern.row(i)].fill(0.0);
            }
        }
        Ok(())
    }
    fn velocity(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        s: &mut GeometryScratch,
        b: &mut [f64],
    ) -> Result<(), SystemError> {
        self.model.velocity(t, q, v, &mut s.model, &mut s.phi)?;
        b.iter_mut().zip(&self.rows).for_each(|(b, &row)| *b = s.phi[row]);
        Ok(())
    }
    fn dynamics(
        &self,
        _t: f64,
        _q: &[f64],
        v: &[f64],
        _s: &mut GeometryScratch,
        mass: &mut [f64],
        h: &mut [f64],
    ) -> Result<(), SystemError> {
        mass.fill(0.0);
        h.fill(0.0);
        for (i, s2) in self.scale2.iter().enumerate() {
            mass[i * v.len() + i] = 1.0 / s2;
        }
        Ok(())
    }
    fn project(
        &self,
        _t: f64,
        _q: &[f64],
        _v: &[f64],
        tangent: &Tangent,
        _s: &mut GeometryScratch,
        md: &mut [f64],
        hd: &mut [f64],
    ) -> Result<(), SystemError> {
        let k = tangent.k;
        md.fill(0.0);
        hd.fill(0.0);
        for (i, s2) in self.scale2.iter().enumerate() {
            let d = &tangent.dt[i * k..(i + 1) * k];
            for (r, x) in d.iter().enumerate().filter(|x| *x.1 != 0.0) {
                hd[r] -= x * tangent.delta[i] / s2;
                for (m, y) in md[r * k..(r + 1) * k].iter_mut().zip(d) {
                    *m += x * y / s2;
                }
            }
        }
        Ok(())
    }
    fn inverse_dynamics(
        &self,
        _t: f64,
        _q: &[f64],
        _v: &[f64],
        vdot: &[f64],
        _s: &mut GeometryScratch,
        out: &mut [f64],
    ) -> Result<(), SystemError> {
        for ((x, v), s2) in out.iter_mut().zip(vdot).zip(&self.scale2) {
            *x = v / s2;
        }
        Ok(())
    }
}

impl Metric for Geometry<'_> {
    fn inverse_mass_diagonal(
        &self,
        _t: f64,
        _q: &[f64],
        _s: &mut GeometryScratch,
        out: &mut [f64],
    ) -> Result<(), SystemError> {
        out.copy_from_slice(&self.scale2);
        Ok(())
    }
    fn inverse_mass_columns(
        &self,
        _t: f64,
        _q: &[f64],
        which: &[usize],
        _s: &mut GeometryScratch,
        out: &mut [f64],
    ) -> Result<(), SystemError> {
        out.fill(0.0);
        for (j, &i) in which.iter().enumerate() {
            out[i * which.len() + j] = self.scale2[i];
        }
        Ok(())
    }
}

impl Manifold for Geometry<'_> {
    fn rate(&self, q: &[f64], v: &[f64], qdot: &mut [f64]) {
        self.model.rate(q, v, qdot);
    }
    fn step(&self, q: &mut [f64], dv: &[f64]) {
        self.model.step(q, dv);
    }
    fn normalise(&self, q: &mut [f64]) -> bool {
        self.model.normalise(q)
    }
    fn travel(&self, v: &[f64]) -> f64 {
        self.model.travel(v)
    }
}

impl Guards for Geometry<'_> {}

impl Methods for Geometry<'_> {}

impl Varied for Geometry<'_> {}
