//! The equations of a mechanism over any scalar: every level in the space of its evaluations.
//!
//! ```text
//! description ──► Model (f64) ──► over::<S>(parameters) ──► Evaluator<S>
//! ```
//!
//! Nothing here branches on a value: derivatives, eight lanes side by side and recordings use the same code.

use crate::clusters::{self, LoadedTangents};
use crate::compile;
use crate::coupling;
use crate::error::DescriptionError;
use crate::force::{ForceScratch, Maker};
use crate::friction_magnitudes::Hold;
use crate::mechanics::Mechanics;
use crate::numbers::Numbers;
use crate::rows::{Owner, Row};
use crate::sparse_mass::MassLayout;
use crate::spec::{Level, Spec, Value};
use crate::tree::{LinkMotion, LinkState, TreeScratch};
use crate::value::{Callers, Functions, Instant};
use crate::zero_position::Placed;
use partita_math::elimination::Pattern;
use partita_math::scalar::{Dual, Scalar};
use partita_math::spatial::{Mat3, Planar, Quaternion, Space, Spatial, Vec3};
use partita_system::clusters::Clusters;
use partita_system::system::ClusterTangent;
use partita_system::SystemError;
use std::sync::Arc;

/// Directions that are differentiated together.
pub(crate) const TOGETHER: usize = 8;

/// Numbers with that many derivatives.
pub(crate) type Wide = Dual<TOGETHER>;

/// A prescribed motion and its row.
#[derive(Clone, Debug)]
pub struct DriveRow {
    /// Name of the drive.
    pub name: String,
    /// Number of the drive in the description.
    pub number: usize,
    /// Driven joint, and which of its velocities.
    pub joint: Option<(usize, usize)>,
    /// Coordinate and velocity, where its joint stands in the tree.
    pub tree: Option<(usize, usize)>,
    /// Motion: position, or rate.
    pub motion: Value,
    /// The coordinate or velocity.
    pub level: Level,
    /// Row.
    pub row: usize,
}

impl DriveRow {
    /// The velocity of the tree that it drives.
    pub fn velocity(&self) -> Option<usize> {
        self.tree.map(|(_, v)| v)
    }
}

/// The tree in the space the evaluations run in.
#[derive(Clone, Debug)]
pub(crate) enum Engine<S: Scalar> {
    /// All motions in one plane: three numbers per twist.
    Planar(Box<Mechanics<Planar<S>>>),
    /// Six.
    Full,
}

/// Forces that depend on the motion to be found: added to those gathered without them.
pub(crate) trait Follow<S: Scalar>: Send + Sync {
    /// Their number.
    fn count(&self) -> usize;
    /// Add them at (t, q, v), the poses and twists last computed, and store their friction magnitudes in the memory of
    /// the forces.
    fn add(&self, model: &Evaluator<S>, at: (S, &[S], &[S]), s: &mut Scratch<S>) -> Result<(), SystemError>;
}

/// Memory of evaluations.
#[derive(Clone, Debug)]
pub struct Scratch<S: Scalar> {
    pub(crate) planar: Option<TreeScratch<Planar<S>>>,
    pub(crate) full: TreeScratch<Spatial<S>>,
    /// Plain arguments of functions known in `f64` alone.
    pub(crate) memory: Vec<f64>,
    /// Memory of the applied forces, in each space.
    pub(crate) planar_forces: ForceScratch<Planar<S>>,
    pub(crate) full_forces: ForceScratch<Spatial<S>>,
    pub(crate) forces_at: bool,
    /// Memory of reaction-dependent frictions.
    pub(crate) hold: Hold,
}

impl<S: Scalar> Scratch<S> {
    /// For no mechanism; allocates nothing.
    pub(crate) fn empty() -> Self {
        Self {
            planar: None,
            full: TreeScratch::empty(),
            memory: Vec::new(),
            planar_forces: ForceScratch::default(),
            full_forces: ForceScratch::default(),
            forces_at: false,
            hold: Hold::default(),
        }
    }
}

/// Run `$body` with `$tree` and `$s` bound to the tree and scratch of the engine.
macro_rules! with_engine {
    ($self:expr, $scratch:expr, |$tree:ident, $s:ident| $body:expr) => {
        match (&$self.engine, &mut $scratch.planar) {
            ($crate::evaluator::Engine::Planar($tree), Some($s)) => $body,
            _ => {
                let ($tree, $s) = (&$self.full, &mut $scratch.full);
                $body
            }
        }
    };
}
pub(crate) use with_engine;

/// A mechanism over the numbers `S`, with the structure of the [`Model`](crate::Model) it was made from.
///
/// Levels are evaluated in order, as in [`ConstrainedSystem`](partita_system::ConstrainedSystem):
/// [`position`](Self::position), [`velocity`](Self::velocity) at the same `(t, q)`, then everything else. User
/// functions are known in `f64` alone: see [`Functions::call`](partita_math::scalar::Functions::call).
pub struct Evaluator<S: Scalar> {
    pub(crate) engine: Engine<S>,
    /// The mechanism in space; outputs and reactions are computed with it.
    pub full: Mechanics<Spatial<S>>,
    /// Zero position: structure, and the numbers of the description.
    pub(crate) placed: Arc<Placed>,
    /// Prescribed motions.
    pub(crate) drives: Vec<DriveRow>,
    pub(crate) numbers: Numbers<S>,
    pub(crate) callers: Arc<Callers>,
    /// Reaction-dependent frictions.
    pub(crate) following: Option<Arc<dyn Follow<S>>>,
}

impl<S: Scalar> Evaluator<S> {
    /// Make trees and forces from numbers; also the names of the rows in the space of the evaluations and in three
    /// dimensions.
    pub(crate) fn new(
        spec: &Spec,
        placed: Arc<Placed>,
        numbers: Numbers<S>,
        drives: Vec<DriveRow>,
        callers: Arc<Callers>,
    ) -> Result<(Self, [Vec<Row>; 2]), DescriptionError> {
        let massive = massive(&placed);
        let (full, full_rows) = mechanics::<Spatial<S>>(spec, &placed, &numbers, &massive, &*callers.functions)?;
        let functions = &*callers.functions;
        if let (false, Some(name)) = (S::CALLS, full.elements.iter().find_map(|e| e.calls(functions))) {
            return Err(uncallable("force", name));
        }
        if let (false, Some(c)) = (S::CALLS, full.conditions.iter().find(|c| c.calls(functions))) {
            let element = match c.owner {
                Owner::Joint(_) => "joint",
                Owner::Coupling(_) => "coupling",
                Owner::Rotor(_) => "rotor",
                Owner::Drive(_) => "drive",
            };
            return Err(uncallable(element, &c.name));
        }
        let (engine, rows) = if placed.planar {
            let (planar, rows) = mechanics::<Planar<S>>(spec, &placed, &numbers, &massive, &*callers.functions)?;
            (Engine::Planar(Box::new(planar)), rows)
        } else {
            (Engine::Full, full_rows.clone())
        };
        Ok((Self { engine, full, placed, drives, numbers, callers, following: None }, [rows, full_rows]))
    }

    /// New scratch. For a planar mechanism the spatial part is allocated by the first [`look`](Self::look): evaluations
    /// need none.
    pub fn scratch(&self) -> Scratch<S> {
        let (planar, full) = match &self.engine {
            Engine::Planar(tree) => (Some(tree.scratch()), TreeScratch::empty()),
            Engine::Full => (None, self.full.scratch()),
        };
        Scratch { planar, full, ..Scratch::empty() }
    }

    pub(crate) fn instant<'a>(&'a self, t: S, q: &'a [S], v: &'a [S]) -> Instant<'a, S> {
        Instant { t, q, v, callers: &self.callers, uncounted: &[] }
    }

    /// As functions of the state see it.
    pub(crate) fn seen_instant<'a>(&'a self, t: S, q: &'a [S], v: &'a [S]) -> Instant<'a, S> {
        Instant { uncounted: &self.full.uncounted, ..self.instant(t, q, v) }
    }

    /// Position level: Φ, the values of C in the order of the model's pattern, and a.          (S3, S4)
    pub fn position(
        &self,
        t: S,
        q: &[S],
        s: &mut Scratch<S>,
        phi: &mut [S],
        c: &mut [S],
        a: &mut [S],
    ) -> Result<(), SystemError> {
        self.closings(t, q, s, phi, c, a)?;
        with_engine!(self, s, |tree, x| tree.inertias(x));
        Ok(())
    }

    /// As [`position`](Self::position), for iterations at position level: no other level may follow.
    pub(crate) fn closings(
        &self,
        t: S,
        q: &[S],
        s: &mut Scratch<S>,
        phi: &mut [S],
        c: &mut [S],
        a: &mut [S],
    ) -> Result<(), SystemError> {
        s.forces_at = false;
        let conditional = with_engine!(self, s, |tree, x| {
            tree.poses_and_closings(q, x, phi, c);
            !tree.conditions.is_empty()
        });
        match conditional {
            true => self.hold(&self.instant(t, q, &[]), s, phi, c, a),
            false => Ok(()),
        }
    }

    /// Φ, C and a of the conditions that no loop closure is.
    fn hold(
        &self,
        at: &Instant<S>,
        s: &mut Scratch<S>,
        phi: &mut [S],
        c: &mut [S],
        a: &mut [S],
    ) -> Result<(), SystemError> {
        let mut memory = std::mem::take(&mut s.memory);
        let held = with_engine!(self, s, |tree, x| tree.hold(at, x, &mut memory, phi, c, a));
        s.memory = memory;
        held
    }

    /// Velocity level, at the `(t, q)` of the last [`position`](Self::position): b.            (S5)
    pub fn velocity(&self, t: S, q: &[S], v: &[S], s: &mut Scratch<S>, b: &mut [S]) -> Result<(), SystemError> {
        s.forces_at = false;
        let conditional = with_engine!(self, s, |tree, x| {
            tree.twists_and_bias(v, x, b);
            !tree.conditions.is_empty()
        });
        match conditional {
            true => self.hold_rates(&self.instant(t, q, v), s, b),
            false => Ok(()),
        }
    }

    /// b of the same conditions.
    fn hold_rates(&self, at: &Instant<S>, s: &mut Scratch<S>, b: &mut [S]) -> Result<(), SystemError> {
        let mut memory = std::mem::take(&mut s.memory);
        let held = with_engine!(self, s, |tree, x| tree.hold_rates(at, x, &mut memory, b));
        s.memory = memory;
        held
    }

    /// Applied forces at the last [`velocity`](Self::velocity), gathered once.
    pub(crate) fn forces(&self, t: S, q: &[S], v: &[S], s: &mut Scratch<S>) -> Result<(), SystemError> {
        if s.forces_at {
            return Ok(());
        }
        if let Some(following) = &self.following {
            // gathered without them first
            let count = following.count();
            for normal_forces in [&mut s.planar_forces.normal_forces, &mut s.full_forces.normal_forces] {
                normal_forces.clear();
                normal_forces.resize(count, S::zero());
            }
        }
        match (&self.engine, &mut s.planar) {
            (Engine::Planar(tree), Some(x)) => tree.apply(self.instant(t, q, v), x, &mut s.planar_forces)?,
            _ => self.full.apply(self.instant(t, q, v), &mut s.full, &mut s.full_forces)?,
        }
        if let Some(following) = &self.following {
            following.add(self, (t, q, v), s)?;
        }
        s.forces_at = true;
        Ok(())
    }

    /// The magnitudes of reaction-dependent frictions at any (t, q, v), stored where elements read them.
    pub(crate) fn reaction_friction_at(&self, t: S, q: &[S], v: &[S], s: &mut Scratch<S>) -> Result<(), SystemError> {
        if self.following.is_none() {
            return Ok(());
        }
        with_engine!(self, s, |tree, x| {
            tree.poses(q, x);
            tree.inertias(x);
            tree.twists(v, x);
        });
        s.forces_at = false;
        self.forces(t, q, v, s)
    }

    /// Dense M (nv x nv) and h (nv), after [`velocity`](Self::velocity).                       (S1)
    pub fn dynamics(
        &self,
        t: S,
        q: &[S],
        v: &[S],
        s: &mut Scratch<S>,
        mass: &mut [S],
        h: &mut [S],
    ) -> Result<(), SystemError> {
        self.forces(t, q, v, s)?;
        with_engine!(self, s, |tree, x| {
            tree.mass_matrix(x, mass);
            tree.forces(x, h);
        });
        Ok(())
    }

    /// The entries of M in the order of the layout, and h (nv), after [`velocity`](Self::velocity). (S1)
    pub(crate) fn sparse_dynamics(
        &self,
        t: S,
        q: &[S],
        v: &[S],
        layout: &MassLayout,
        s: &mut Scratch<S>,
        mass: &mut [S],
        h: &mut [S],
    ) -> Result<(), SystemError> {
        self.forces(t, q, v, s)?;
        with_engine!(self, s, |tree, x| {
            tree.sparse_mass(layout, x, mass);
            tree.forces(x, h);
        });
        Ok(())
    }

    /// `M_d = D M Dᵀ`, `h_d = D (h − M [0; ξ])` for Dᵀ (nv x k) and `[0; ξ]`, after [`velocity`](Self::velocity). (P3)
    pub fn project(
        &self,
        t: S,
        q: &[S],
        v: &[S],
        (k, dt, delta): (usize, &[S], &[S]),
        s: &mut Scratch<S>,
        md: &mut [S],
        hd: &mut [S],
    ) -> Result<(), SystemError> {
        self.forces(t, q, v, s)?;
        with_engine!(self, s, |tree, x| tree.project(k, dt, delta, x, md, hd));
        Ok(())
    }

    /// `v'` with `C v' + b = 0` by the recursion over clusters, after [`velocity`](Self::velocity). `s` must have been fitted
    /// to the plan.                                                                        (P3 by clusters, 48)
    pub fn accelerate(
        &self,
        t: S,
        q: &[S],
        v: &[S],
        plan: &clusters::Plan,
        tangents: &ClusterTangent<S>,
        s: &mut Scratch<S>,
        vdot: &mut [S],
    ) -> Result<(), SystemError> {
        self.forces(t, q, v, s)?;
        with_engine!(self, s, |tree, x| {
            let mut memory = std::mem::take(&mut x.clusters);
            let given = LoadedTangents { tangents: *tangents, effort: &x.effort, at_rest: false };
            tree.accelerate(plan, &given, x, &mut memory, vdot);
            x.clusters = memory;
        });
        Ok(())
    }

    /// Motion that efforts (nv) alone cause from rest, after [`position`](Self::position).
    pub fn respond(
        &self,
        plan: &clusters::Plan,
        tangents: &ClusterTangent<S>,
        effort: &[S],
        s: &mut Scratch<S>,
        out: &mut [S],
    ) {
        with_engine!(self, s, |tree, x| {
            let mut memory = std::mem::take(&mut x.clusters);
            tree.accelerate(plan, &LoadedTangents { tangents: *tangents, effort, at_rest: true }, x, &mut memory, out);
            x.clusters = memory;
        });
    }

    /// Plan of the recursion over clusters for the rows of C that are kept: it depends on structure alone.
    pub fn plan(
        &self,
        pattern: &Pattern,
        of: &Clusters,
        kept: &[usize],
        preference: clusters::Preference,
    ) -> clusters::Plan {
        match &self.engine {
            Engine::Planar(tree) => clusters::Plan::new::<Planar<S>>(tree, pattern, of, kept, preference),
            Engine::Full => clusters::Plan::new::<Spatial<S>>(&self.full, pattern, of, kept, preference),
        }
    }

    /// Memory for the recursion over clusters with this plan.
    pub fn fit(&self, plan: &clusters::Plan, s: &mut Scratch<S>) {
        let velocities = self.placed.nv;
        with_engine!(self, s, |tree, x| x.clusters.fit(tree.links.len(), velocities, tree.dimensions(), plan));
    }

    /// `M v' − h` (nv), after [`velocity`](Self::velocity).
    pub fn inverse_dynamics(
        &self,
        t: S,
        q: &[S],
        v: &[S],
        vdot: &[S],
        s: &mut Scratch<S>,
        out: &mut [S],
    ) -> Result<(), SystemError> {
        self.forces(t, q, v, s)?;
        with_engine!(self, s, |tree, x| tree.inverse_dynamics(vdot, x, out));
        Ok(())
    }

    /// `[M⁻¹]_ii` (nv) after [`position`](Self::position), by articulated inertias; no pivot is looked at.   (19)
    pub fn inverse_mass_diagonal(&self, s: &mut Scratch<S>, out: &mut [S]) {
        with_engine!(self, s, |tree, x| {
            tree.articulate_straight(x);
            tree.inverse_mass_diagonal(x, out);
        });
    }

    /// Kinetic energy, potential energy, and the power of the forces that have no potential, after
    /// [`velocity`](Self::velocity). The power of reaction-dependent frictions is available after the dynamics only.
    pub fn energies(&self, t: S, q: &[S], v: &[S], s: &Scratch<S>) -> Result<[S; 3], SystemError> {
        let instant = self.instant(t, q, v);
        // plain numbers need no memory, except for a law
        match (&self.engine, &s.planar) {
            (Engine::Planar(tree), Some(x)) => {
                tree.energies(instant, x, &mut ForceScratch::with_normal_forces(&s.planar_forces))
            }
            _ => self.full.energies(instant, &s.full, &mut ForceScratch::with_normal_forces(&s.full_forces)),
        }
    }

    /// The power of the forces that have no potential alone, with the memory of the scratch.
    pub(crate) fn power(&self, t: S, q: &[S], v: &[S], s: &mut Scratch<S>) -> Result<S, SystemError> {
        if self.following.is_some() {
            self.forces(t, q, v, s)?;
        }
        let instant = self.instant(t, q, v);
        let [_, power] = match (&self.engine, &s.planar) {
            (Engine::Planar(tree), Some(x)) => tree.potential_and_power(instant, x, &mut s.planar_forces),
            _ => self.full.potential_and_power(instant, &s.full, &mut s.full_forces),
        }?;
        Ok(power)
    }

    /// Poses and twists in space at (q, v), for outputs and reactions; for planar mechanisms also the positions in the
    /// plane.
    pub fn look(&self, q: &[S], v: &[S], s: &mut Scratch<S>) {
        self.full.fit(&mut s.full);
        self.full.poses(q, &mut s.full);
        self.full.inertias(&mut s.full);
        self.full.twists(v, &mut s.full);
        if let (Engine::Planar(tree), Some(planar)) = (&self.engine, &mut s.planar) {
            tree.poses(q, planar);
            tree.inertias(planar);
            tree.twists(v, planar);
        }
    }

    /// State of a node's link (0 is the ground) in mechanism axes, its reference point in the world.
    pub(crate) fn node_state(&self, s: &Scratch<S>, node: usize) -> LinkState<Spatial<S>> {
        let link = self.placed.link_of(node);
        let mut state = s.full.links[link];
        state.centre = self.full.reference_point(link, &s.full);
        state
    }

    /// Reference points of all links in the zero position: centres of mass, or the joint's point where there is no mass.
    pub fn reference(&self) -> &[Vec3<S>] {
        &self.numbers.reference
    }

    /// Offset of a zero-position point from the reference point of its link, in present world axes.
    pub(crate) fn arm_now(&self, s: &Scratch<S>, link: usize, zero: Vec3<S>) -> Vec3<S> {
        s.full.links[link].rot.apply(zero - self.numbers.reference[link])
    }

    /// `q' = N(q) v`.                                                                          (S2)
    pub fn rate(&self, q: &[S], v: &[S], qdot: &mut [S]) {
        if self.placed.nq == self.placed.nv {
            qdot.copy_from_slice(v);
            return;
        }
        for l in self.full.links.iter().skip(1) {
            if matches!(l.motion, LinkMotion::Ball) {
                let p = Quaternion([q[l.q], q[l.q + 1], q[l.q + 2], q[l.q + 3]]);
                qdot[l.q..l.q + 4].copy_from_slice(&p.rate(Vec3([v[l.v], v[l.v + 1], v[l.v + 2]])));
            } else {
                qdot[l.q] = v[l.v];
            }
        }
    }

    /// Move `q` by the small velocity-like increment `dv` (an exponential for spatial rotations).
    pub fn step(&self, q: &mut [S], dv: &[S]) {
        if self.placed.nq == self.placed.nv {
            q.iter_mut().zip(dv).for_each(|(q, dv)| *q += *dv);
            return;
        }
        for l in self.full.links.iter().skip(1) {
            if matches!(l.motion, LinkMotion::Ball) {
                let p = Quaternion([q[l.q], q[l.q + 1], q[l.q + 2], q[l.q + 3]]);
                let turned = p.times(&Quaternion::exp(Vec3([dv[l.v], dv[l.v + 1], dv[l.v + 2]])));
                q[l.q..l.q + 4].copy_from_slice(&turned.0);
            } else {
                q[l.q] += dv[l.v];
            }
        }
    }

    /// Bring all quaternions to unit length.
    pub fn normalise(&self, q: &mut [S]) {
        for l in self.full.links.iter().skip(1).filter(|l| matches!(l.motion, LinkMotion::Ball)) {
            let p = Quaternion([q[l.q], q[l.q + 1], q[l.q + 2], q[l.q + 3]]);
            q[l.q..l.q + 4].copy_from_slice(&p.normalised().0);
        }
    }
}

/// Tree, conditions and forces in one space; also the names of the rows.
fn mechanics<G: Space>(
    spec: &Spec,
    placed: &Placed,
    numbers: &Numbers<G::S>,
    massive: &[bool],
    functions: &dyn Functions,
) -> Result<(Mechanics<G>, Vec<Row>), DescriptionError> {
    let (tree, mut rows) = compile::compile::<G>(spec, placed, numbers);
    let conditions = coupling::all(spec, placed, numbers, &tree)?;
    rows.extend(conditions.iter().flat_map(|c| c.named(spec)));
    let maker = Maker::new(spec, placed, numbers, &tree)?;
    let elements = maker.elements()?;
    let sees_state = elements.iter().any(|e| e.sees_state(functions));
    let (sights, sensed) = (maker.sights(sees_state)?, maker.sensed(sees_state)?);
    let out = Mat3::from_f64(placed.basis.transpose().0);
    Ok((Mechanics::new(tree, conditions, elements, sights, massive).sensing(placed.nq, sensed, out), rows))
}

/// Links with mass or inertia.
fn massive(placed: &Placed) -> Vec<bool> {
    let mut massive = vec![false; placed.links.len()];
    for b in &placed.bodies {
        massive[b.link] |= b.mass != 0.0 || b.inertia.0.concat().iter().any(|x| *x != 0.0);
    }
    placed.held.iter().for_each(|x| massive[placed.bodies[x.body].link] = true);
    massive
}

fn uncallable(element: &'static str, name: &str) -> DescriptionError {
    let message = "it calls a function, which cannot be recorded; give a table or a number";
    DescriptionError::new(element, name, message)
}
