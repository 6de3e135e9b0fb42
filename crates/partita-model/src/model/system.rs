//! The compiled mechanism as a [`ConstrainedSystem`](partita_system::ConstrainedSystem): every level in the space of
//! its evaluations.

use super::scratch::{Dense, ModelScratch};
use super::Model;
use crate::clusters::{Plan, Preference, Route};
use crate::evaluator::{with_engine, Engine};
use crate::joint::{Motion, Own};
use crate::tree::LinkMotion;
use partita_math::dense;
use partita_math::elimination::Pattern;
use partita_math::spatial::{Mat3, Quaternion};
use partita_math::tolerance;
use partita_system::system::{project_dense, BlockSink, ClusterTangent, Recursion, Structure, Tangent};
use partita_system::system::{Clustered, Guards, Levels, Manifold, Metric};
use partita_system::watched::{Reading, Watched};
use partita_system::SystemError;

/// Up to this many degrees of freedom one small M_d costs less than any recursion, and existing bases use the same
/// method.
const FEW_DOF: usize = 6;

impl Model {
    /// Whether the result of the recursion is a motion. Otherwise some velocity moves no inertia.
    fn felt(&self, t: f64, s: &ModelScratch, vdot: &[f64]) -> Result<(), SystemError> {
        if vdot.iter().all(|x| x.is_finite()) {
            return Ok(());
        }
        let pivots = match (&self.own.engine, &s.evaluated().planar) {
            (Engine::Planar(_), Some(x)) => x.clusters.pivots(),
            _ => s.evaluated().full.clusters.pivots(),
        };
        match pivots.iter().position(|x| *x <= 0.0) {
            Some(v) => Err(self.mass_error((v, pivots[v]))),
            None => Err(SystemError::NotFinite { what: "an acceleration".into(), t }),
        }
    }
}

impl Model {
    /// The recursion over clusters with these rows kept.
    pub fn recursion(&self, kept: &[usize]) -> Plan {
        self.own.plan(&self.structure.pattern, &self.structure.clusters, kept, self.preference)
    }
}

impl Levels for Model {
    type Scratch = ModelScratch;
    fn structure(&self) -> &Structure {
        &self.structure
    }
    fn scratch(&self) -> ModelScratch {
        let spare = self.spare.all().pop();
        let (own, dense) = spare.unwrap_or_else(|| (Box::new(self.own.scratch()), Dense::default()));
        ModelScratch { own: Some(own), dense, recursion: Plan::default(), spare: self.spare.clone() }
    }
    fn position(
        &self,
        t: f64,
        q: &[f64],
        s: &mut ModelScratch,
        phi: &mut [f64],
        c: &mut [f64],
        a: &mut [f64],
    ) -> Result<(), SystemError> {
        self.own.position(t, q, s.equations(), phi, c, a)
    }
    fn velocity(&self, t: f64, q: &[f64], v: &[f64], s: &mut ModelScratch, b: &mut [f64]) -> Result<(), SystemError> {
        self.own.velocity(t, q, v, s.equations(), b)
    }
    fn dynamics(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        s: &mut ModelScratch,
        mass: &mut [f64],
        h: &mut [f64],
    ) -> Result<(), SystemError> {
        self.own.dynamics(t, q, v, s.equations(), mass, h)
    }
    fn project(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        tangent: &Tangent,
        s: &mut ModelScratch,
        md: &mut [f64],
        hd: &mut [f64],
    ) -> Result<(), SystemError> {
        if self.dense_projection {
            let n = v.len();
            let mut d = std::mem::take(&mut s.dense);
            d.mass.resize(n * n, 0.0);
            d.h.resize(n, 0.0);
            let (mut mass, mut h) = (std::mem::take(&mut d.mass), std::mem::take(&mut d.h));
            s.dense = d;
            self.dynamics(t, q, v, s, &mut mass, &mut h)?;
            let mut d = std::mem::take(&mut s.dense);
            d.work.resize(n.max(tangent.k), 0.0);
            project_dense(&mass, &h, tangent, &mut d.work, md, hd);
            (d.mass, d.h) = (mass, h);
            s.dense = d;
            return Ok(());
        }
        self.own.project(t, q, v, (tangent.k, tangent.dt, tangent.delta), s.equations(), md, hd)
    }
    fn inverse_dynamics(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        vdot: &[f64],
        s: &mut ModelScratch,
        out: &mut [f64],
    ) -> Result<(), SystemError> {
        self.own.inverse_dynamics(t, q, v, vdot, s.equations(), out)
    }
    fn power(&self, t: f64, q: &[f64], v: &[f64], s: &mut ModelScratch) -> Result<f64, SystemError> {
        if !self.structure.has_power {
            return Ok(0.0);
        }
        self.own.power(t, q, v, s.equations())
    }
}

impl Metric for Model {
    fn mass_pattern(&self) -> Pattern {
        self.mass_layout().pattern.clone()
    }
    fn sparse_dynamics(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        s: &mut ModelScratch,
        mass: &mut [f64],
        h: &mut [f64],
    ) -> Result<(), SystemError> {
        self.own.sparse_dynamics(t, q, v, self.mass_layout(), s.equations(), mass, h)
    }
    fn add_metric(&self, s: &mut ModelScratch, mass: &mut [f64]) {
        with_engine!(self.own, s.equations(), |tree, x| tree.add_massless(x, mass));
    }
    fn inverse_mass_diagonal(
        &self,
        _t: f64,
        _q: &[f64],
        s: &mut ModelScratch,
        out: &mut [f64],
    ) -> Result<(), SystemError> {
        with_engine!(self.own, s.equations(), |tree, x| {
            tree.articulate(x).map_err(|e| self.mass_error(e))?;
            tree.inverse_mass_diagonal(x, out);
        });
        Ok(())
    }
    fn inverse_mass_columns(
        &self,
        _t: f64,
        _q: &[f64],
        which: &[usize],
        s: &mut ModelScratch,
        out: &mut [f64],
    ) -> Result<(), SystemError> {
        let n = self.own.placed.nv;
        let (mut effort, mut column) = (vec![0.0; n], vec![0.0; n]);
        with_engine!(self.own, s.equations(), |tree, x| {
            tree.articulate(x).map_err(|e| self.mass_error(e))?;
            for (j, &c) in which.iter().enumerate() {
                effort.fill(0.0);
                effort[c] = 1.0;
                tree.inverse_mass_product(&effort, x, &mut column);
                for i in 0..n {
                    out[i * which.len() + j] = column[i];
                }
            }
        });
        Ok(())
    }
}

impl Clustered<ModelScratch> for Model {
    fn plan_recursion(&self, kept: &[usize], s: &mut ModelScratch) -> Option<Recursion> {
        let k = self.own.placed.nv.saturating_sub(kept.len());
        let counted = self.preference == Preference::Counted;
        if self.preference == Preference::Dense || counted && k <= FEW_DOF {
            return None;
        }
        let plan = self.recursion(kept);
        if counted && self.dense_cost(k) <= plan.cost {
            return None;
        }
        self.own.fit(&plan, s.equations());
        let by_partial_velocities = plan.routes.iter().map(|w| *w == Route::PartialVelocities).collect();
        let recursion = Recursion { columns: plan.columns, by_partial_velocities };
        s.recursion = plan;
        Some(recursion)
    }
    fn accelerate(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        tangent: &ClusterTangent,
        s: &mut ModelScratch,
        vdot: &mut [f64],
    ) -> Result<(), SystemError> {
        let plan = std::mem::take(&mut s.recursion);
        let done = self.own.accelerate(t, q, v, &plan, tangent, s.equations(), vdot);
        s.recursion = plan;
        done?;
        self.felt(t, s, vdot)
    }
    fn respond(
        &self,
        tangent: &ClusterTangent,
        effort: &[f64],
        s: &mut ModelScratch,
        out: &mut [f64],
    ) -> Result<(), SystemError> {
        let plan = std::mem::take(&mut s.recursion);
        self.own.respond(&plan, tangent, effort, s.equations(), out);
        s.recursion = plan;
        self.felt(0.0, s, out)
    }
    fn respond_freely(&self, effort: &[f64], s: &mut ModelScratch, out: &mut [f64]) -> Result<(), SystemError> {
        with_engine!(self.own, s.equations(), |tree, x| {
            tree.articulate(x).map_err(|e| self.mass_error(e))?;
            tree.inverse_mass_product(effort, x, out);
        });
        Ok(())
    }
    fn mobility(
        &self,
        tangent: &ClusterTangent,
        independent: &[usize],
        most: usize,
        s: &mut ModelScratch,
        diagonal: &mut [f64],
        block: BlockSink,
    ) {
        let plan = &s.recursion;
        let of = &self.structure.clusters.of_velocity;
        match (&self.own.engine, &s.evaluated().planar) {
            (Engine::Planar(tree), Some(x)) => {
                tree.mobility(plan, tangent.dt, independent, most, of, x, &x.clusters, diagonal, block);
            }
            _ => {
                let x = &s.evaluated().full;
                self.own.full.mobility(plan, tangent.dt, independent, most, of, x, &x.clusters, diagonal, block);
            }
        }
    }
    fn cluster_mass<'x>(&self, n: usize, s: &'x ModelScratch) -> &'x [f64] {
        match (&self.own.engine, &s.evaluated().planar) {
            (Engine::Planar(tree), Some(x)) => tree.cluster_mass(&s.recursion, n, &x.clusters),
            _ => self.own.full.cluster_mass(&s.recursion, n, &s.evaluated().full.clusters),
        }
    }
}

impl Manifold for Model {
    fn rate(&self, q: &[f64], v: &[f64], qdot: &mut [f64]) {
        self.own.rate(q, v, qdot);
    }
    fn step(&self, q: &mut [f64], dv: &[f64]) {
        self.own.step(q, dv);
    }
    fn normalise(&self, q: &mut [f64]) -> bool {
        if self.own.placed.nq == self.own.placed.nv {
            return false;
        }
        let mut moved = false;
        for l in self.own.full.links.iter().skip(1) {
            if matches!(l.motion, LinkMotion::Ball) {
                let p = Quaternion([q[l.q], q[l.q + 1], q[l.q + 2], q[l.q + 3]]);
                if (dense::dot(&p.0, &p.0) - 1.0).abs() > tolerance::ROUNDING {
                    q[l.q..l.q + 4].copy_from_slice(&p.normalised().0);
                    moved = true;
                }
            }
        }
        moved
    }
    fn travel(&self, v: &[f64]) -> f64 {
        let (mut fastest, mut slide, mut slides) = (0.0f64, 0.0, 0);
        for l in self.own.placed.links.iter().skip(1) {
            // consecutive slides of one body or joint form one displacement, whatever the axes
            match l.motion {
                Motion::Slide(_) if slides % 3 != 0 => {
                    slide += (v[l.v] / self.structure.velocities[l.v].displacement).powi(2)
                }
                Motion::Slide(_) => slide = (v[l.v] / self.structure.velocities[l.v].displacement).powi(2),
                Motion::Turn(_) => fastest = fastest.max(v[l.v].abs()),
                Motion::Ball => fastest = fastest.max(v[l.v..l.v + 3].iter().map(|x| x * x).sum::<f64>().sqrt()),
            }
            slides = if matches!(l.motion, Motion::Slide(_)) { slides + 1 } else { 0 };
            fastest = fastest.max(slide.sqrt());
        }
        fastest
    }
    fn turned_over(&self, q: &[f64]) -> Vec<usize> {
        if self.is_planar() {
            return Vec::new(); // a turn in the plane is closed as an angle
        }
        let mut s = self.own.full.scratch();
        self.own.full.poses(q, &mut s);
        let over = self.own.full.closings.iter().filter(|k| {
            let p = &self.own.placed.joints[k.joint];
            let axes = |node: usize, on: &Mat3<f64>| s.links[self.own.placed.link_of(node)].rot.mul(on);
            let r = axes(p.parent, &p.on_parent).transpose().mul(&axes(p.child, &p.on_child));
            let turns: Vec<_> = p.shape.motions.iter().filter(|m| !matches!(m, Motion::Slide(_))).collect();
            match turns.as_slice() {
                [] if p.shape.own == Some(Own::Twist) => {
                    r.apply(p.shape.frame.column(2)).dot(p.shape.frame.column(2)) < 0.0
                }
                // other roots of three perpendicular pairs are rotated by 120 degrees and more
                [] => r.0[0][0] + r.0[1][1] + r.0[2][2] < 1.0,
                [Motion::Turn(a)] => a.dot(r.apply(*a)) < 0.0,
                _ => false,
            }
        });
        over.map(|k| k.row + k.slide_rows()).collect()
    }
}

impl Guards for Model {
    fn watched(&self) -> Watched {
        Watched {
            guards: self.guarded(),
            breakpoints: self.curves().breakpoints.clone(),
            discontinuities: crate::time_domain::discontinuities(&self.spec),
            domain: crate::time_domain::time_domain(&self.spec),
        }
    }
    fn readings(&self, t: f64, q: &[f64], v: &[f64], s: &mut ModelScratch, out: &mut [Reading]) {
        let (of_guards, of_curves) = out.split_at_mut(out.len() - self.curves().breakpoints.len());
        if !of_guards.is_empty() {
            self.own.read_guards(t, (q, v), s.equations(), of_guards);
        }
        if !of_curves.is_empty() {
            self.curves().read(&self.own, t, (q, v), s.equations(), of_curves);
        }
    }
}
