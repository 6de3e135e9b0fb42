//! The compiled mechanism as a [`ConstrainedSystem`](partita_system::ConstrainedSystem): every level in the space of
//! its evaluations.

use super::scratch::{Dense, ModelScratch};
use super::{BlockDecision, Geometry, Model};
use crate::clusters::{Plan, Preference, Route};
use crate::coupling::Condition;
use crate::evaluator::{with_engine, Engine};
use crate::joint::{Motion, Own};
use crate::rows::Owner;
use crate::spec::Coupling;
use crate::tree::LinkMotion;
use partita_math::dense;
use partita_math::elimination::Pattern;
use partita_math::formatted;
use partita_math::scalar::Recording;
use partita_math::spatial::{Mat3, Quaternion};
use partita_math::tolerance;
use partita_system::choice::Choice;
use partita_system::clusters::Clusters;
use partita_system::compiled::CompiledRates;
use partita_system::system::{project_dense, BlockSink, ClusterTangent, Recursion, Tangent};
use partita_system::system::{Clustered, Conditions, Guards, Levels, Manifold, Metric, Names, Programs, Scales};
use partita_system::watched::{Reading, Watched};
use partita_system::{Finite, Size, SystemError, SystemRef};
use std::sync::Arc;

/// Up to this many degrees of freedom one small M_d costs less than any recursion, and existing bases use the same
/// method.
const FEW_DOF: usize = 6;

impl Model {
    /// Whether the result of the recursion is a motion. Otherwise some velocity moves no inertia.
    fn felt(&self, t: f64, s: &ModelScratch, vdot: &[f64]) -> Result<(), SystemError> {
        if vdot.iter().all(|x| x.is_finite()) {
            return Ok(());
        }
        let pivots = match (&self.engine, &s.planar) {
            (Engine::Planar(_), Some(x)) => x.clusters.pivots(),
            _ => s.full.clusters.pivots(),
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
        self.own.plan(&self.pattern, &self.clusters, kept, self.preference)
    }
}

impl Levels for Model {
    type Scratch = ModelScratch;
    fn size(&self) -> Size {
        Size { nq: self.placed.nq, nv: self.placed.nv, rows: self.pattern.rows, holonomic: self.holonomic }
    }
    fn pattern(&self) -> &Pattern {
        &self.pattern
    }
    fn scratch(&self) -> ModelScratch {
        let spare = self.spare.all().pop();
        let (own, dense) = spare.unwrap_or_else(|| (Box::new(self.own.scratch()), Dense::default()));
        ModelScratch { own: Some(own), dense, recursion: Plan::default(), spare: self.spare.clone() }
    }
    fn rheonomic(&self) -> bool {
        self.full.conditions.iter().any(Condition::is_rheonomic)
    }
    fn has_power(&self) -> bool {
        self.has_power
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
        self.own.position(t, q, s, phi, c, a)
    }
    fn velocity(&self, t: f64, q: &[f64], v: &[f64], s: &mut ModelScratch, b: &mut [f64]) -> Result<(), SystemError> {
        self.own.velocity(t, q, v, s, b)
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
        self.own.dynamics(t, q, v, s, mass, h)
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
        self.own.project(t, q, v, (tangent.k, tangent.dt, tangent.delta), s, md, hd)
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
        self.own.inverse_dynamics(t, q, v, vdot, s, out)
    }
    fn power(&self, t: f64, q: &[f64], v: &[f64], s: &mut ModelScratch) -> Result<f64, SystemError> {
        if !self.has_power {
            return Ok(0.0);
        }
        self.own.power(t, q, v, s)
    }
}

impl Programs for Model {
    fn recorded_rates(&self, choice: &Choice, most: usize) -> Option<Recording> {
        self.rates_of(choice, most)
    }
    fn compiled_rates(&self, choice: &Choice) -> Option<Arc<CompiledRates>> {
        self.compiled.of(choice)
    }
    fn given_count(&self) -> usize {
        self.callers.functions.given_count()
    }
    fn given_number(&self, place: usize) -> f64 {
        self.callers.functions.given_number(place)
    }
    fn beside(system: &SystemRef<Self>, work: impl FnOnce(&Self) + Send + 'static) -> bool {
        let SystemRef::Shared(model) = system else { return false };
        let model = model.clone();
        std::thread::Builder::new().spawn(move || work(&model)).is_ok()
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
        self.own.sparse_dynamics(t, q, v, self.mass_layout(), s, mass, h)
    }
    fn lacks_mass(&self) -> bool {
        !self.placed.massless.is_empty()
    }
    fn add_metric(&self, s: &mut ModelScratch, mass: &mut [f64]) {
        with_engine!(self, s, |tree, x| tree.add_massless(x, mass));
    }
    fn inverse_mass_diagonal(
        &self,
        _t: f64,
        _q: &[f64],
        s: &mut ModelScratch,
        out: &mut [f64],
    ) -> Result<(), SystemError> {
        with_engine!(self, s, |tree, x| {
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
        let n = self.placed.nv;
        let (mut effort, mut column) = (vec![0.0; n], vec![0.0; n]);
        with_engine!(self, s, |tree, x| {
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

impl Clustered for Model {
    fn clusters(&self) -> Clusters {
        self.clusters.clone()
    }
    fn plan_recursion(&self, kept: &[usize], s: &mut ModelScratch) -> Option<Recursion> {
        let k = self.placed.nv.saturating_sub(kept.len());
        let counted = self.preference == Preference::Counted;
        if self.preference == Preference::Dense || counted && k <= FEW_DOF {
            return None;
        }
        let plan = self.recursion(kept);
        if counted && self.dense_cost(k) <= plan.cost {
            return None;
        }
        self.own.fit(&plan, s);
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
        let done = self.own.accelerate(t, q, v, &plan, tangent, s, vdot);
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
        self.own.respond(&plan, tangent, effort, s, out);
        s.recursion = plan;
        self.felt(0.0, s, out)
    }
    fn respond_freely(&self, effort: &[f64], s: &mut ModelScratch, out: &mut [f64]) -> Result<(), SystemError> {
        with_engine!(self, s, |tree, x| {
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
        let of = &self.clusters.of_velocity;
        match (&self.engine, &s.planar) {
            (Engine::Planar(tree), Some(x)) => {
                tree.mobility(plan, tangent.dt, independent, most, of, x, &x.clusters, diagonal, block);
            }
            _ => {
                let x = &s.full;
                self.full.mobility(plan, tangent.dt, independent, most, of, x, &x.clusters, diagonal, block);
            }
        }
    }
    fn cluster_mass<'x>(&self, n: usize, s: &'x ModelScratch) -> &'x [f64] {
        match (&self.engine, &s.planar) {
            (Engine::Planar(tree), Some(x)) => tree.cluster_mass(&s.recursion, n, &x.clusters),
            _ => self.full.cluster_mass(&s.recursion, n, &s.full.clusters),
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
        if self.placed.nq == self.placed.nv {
            return false;
        }
        let mut moved = false;
        for l in self.full.links.iter().skip(1) {
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
    fn turns(&self, i: usize) -> bool {
        self.turns[i]
    }
    fn repeats(&self, i: usize) -> bool {
        self.repeats[i]
    }
    fn coordinates_of(&self, i: usize) -> std::ops::Range<usize> {
        self.coordinates_of[i].clone()
    }
    fn velocity_of_coordinate(&self, i: usize) -> Option<usize> {
        self.velocity_of[i]
    }
}

impl Scales for Model {
    fn travel(&self, v: &[f64]) -> f64 {
        let (mut fastest, mut slide, mut slides) = (0.0f64, 0.0, 0);
        for l in self.placed.links.iter().skip(1) {
            // consecutive slides of one body or joint form one displacement, whatever the axes
            match l.motion {
                Motion::Slide(_) if slides % 3 != 0 => slide += (v[l.v] / self.displacement[l.v]).powi(2),
                Motion::Slide(_) => slide = (v[l.v] / self.displacement[l.v]).powi(2),
                Motion::Turn(_) => fastest = fastest.max(v[l.v].abs()),
                Motion::Ball => fastest = fastest.max(v[l.v..l.v + 3].iter().map(|x| x * x).sum::<f64>().sqrt()),
            }
            slides = if matches!(l.motion, Motion::Slide(_)) { slides + 1 } else { 0 };
            fastest = fastest.max(slide.sqrt());
        }
        fastest
    }
    fn characteristic_displacement(&self, i: usize) -> f64 {
        self.displacement[i]
    }
    fn drawing_errors(&self) -> (f64, f64) {
        (self.geometry.geometric_error(), self.spec.drawing_tolerance)
    }
    fn row_displacement(&self, i: usize) -> Option<f64> {
        self.row_displacement[i]
    }
    fn row_is_angle(&self, i: usize) -> bool {
        self.row_is_angle[i]
    }
}

impl Names for Model {
    fn velocity_name(&self, i: usize) -> String {
        self.placed.velocity_names[i].clone()
    }
    fn row_name(&self, i: usize) -> String {
        self.row_names[i].name.clone()
    }
    fn row_description(&self, i: usize) -> String {
        let row = &self.row_names[i];
        match (row.owner, row.name.rsplit_once('.')) {
            (Owner::Joint(_), Some((joint, what))) => format!("joint \"{joint}\" in {what}"),
            _ => self.row_owner(i),
        }
    }
    fn row_owner(&self, i: usize) -> String {
        self.row_names[i].owner.words(&self.spec)
    }
    fn instantaneous(&self) -> String {
        let shaky = self.geometry.blocks.iter().filter(|x| x.verdict == BlockDecision::Shaky);
        let names: Vec<String> =
            shaky.flat_map(|x| &x.joints).map(|&j| format!("\"{}\"", self.spec.joints[j].name)).collect();
        match names.as_slice() {
            [] => self.spec.couplings.iter().take(6).map(|c| c.name().to_string()).collect::<Vec<_>>().join(", "),
            few if few.len() <= 8 => format!("joints {}", few.join(", ")),
            many => format!("joints {} and {} more", many[..8].join(", "), many.len() - 8),
        }
    }
    fn bodies_moved(&self, q: &[f64], v: &[f64]) -> Vec<String> {
        let mut s = self.own.scratch();
        self.look(q, v, &mut s);
        let speed = |link: usize| {
            let x = &s.full.links[link];
            x.w.norm().max(x.u.norm() / self.placed.length)
        };
        let all: Vec<f64> = self.placed.bodies.iter().map(|b| speed(b.link)).collect();
        let most = all.iter().copied().fold(0.0, f64::max);
        let moving = self.spec.bodies.iter().zip(all).filter(|x| x.1 > tolerance::TAKES_PART * most);
        moving.map(|x| x.0.name.clone()).collect()
    }
    fn start_notes(&self, q: &[f64], v: &[f64]) -> Result<Vec<String>, SystemError> {
        if self.placed.held.is_empty() {
            return Ok(Vec::new());
        }
        let mut s = self.own.scratch();
        self.look(q, v, &mut s);
        let fastest = s.full.links.iter().fold(0.0, |m: f64, x| m.max(x.w.norm()).max(x.u.norm() / self.placed.length));
        for x in &self.placed.held {
            let state = &s.full.links[self.placed.bodies[x.body].link];
            let spin = x.line.map_or_else(|| state.w.norm(), |e| state.w.dot(state.rot.apply(e)));
            if spin.abs() > tolerance::WORST_ROUNDING * fastest {
                let name = &self.spec.bodies[x.body].name;
                let about = if x.line.is_some() { "about its own line" } else { "about itself" };
                let message = format!(
                    "body \"{name}\" starts with a spin of {} rad/s {about}, but has no inertia about that axis, so \
                     the motion is indeterminate; give it an axial inertia (add_body; m r^2 / 2 for a round bar), or \
                     omit the spin, which is then held",
                    formatted(spin)
                );
                return Err(SystemError::argument("rates", message));
            }
        }
        Ok(self.held_note().into_iter().collect())
    }
}

impl Conditions for Model {
    fn finite(&self) -> Option<Finite> {
        let Geometry { dof, instantaneous, weak, hidden, .. } = *self.geometry;
        dof.map(|dof| Finite { dof, instantaneous, weak, hidden })
    }
    fn ambiguous(&self) -> Option<String> {
        self.geometry.ambiguous.clone()
    }
    fn row_is_drive(&self, i: usize) -> bool {
        matches!(self.row_names[i].owner, Owner::Drive(_))
    }
    fn row_may_jump(&self, i: usize) -> bool {
        match self.row_names[i].owner {
            Owner::Drive(_) => true,
            Owner::Coupling(k) => matches!(self.spec.couplings[k], Coupling::Function { .. }),
            Owner::Joint(_) | Owner::Rotor(_) => false,
        }
    }
    fn turned_over(&self, q: &[f64]) -> Vec<usize> {
        if self.is_planar() {
            return Vec::new(); // a turn in the plane is closed as an angle
        }
        let mut s = self.full.scratch();
        self.full.poses(q, &mut s);
        let over = self.full.closings.iter().filter(|k| {
            let p = &self.placed.joints[k.joint];
            let axes = |node: usize, on: &Mat3<f64>| s.links[self.placed.link_of(node)].rot.mul(on);
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
            self.own.read_guards(t, (q, v), s, of_guards);
        }
        if !of_curves.is_empty() {
            self.curves().read(&self.own, t, (q, v), s, of_curves);
        }
    }
}
