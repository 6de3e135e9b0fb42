//! Normal forces of the frictions: reactions without friction, and for a unit of each.

use super::{Followed, Following, ReactionFriction, Read};
use crate::evaluator::Evaluator;
use crate::force::{AppliedWrench, At, Bearing, Effect, ForceApplication, ForceScratch};
use crate::friction_magnitudes::{Hold, Jam, OfConditions, Term};
use crate::mechanics::Mechanics;
use crate::tree::TreeScratch;
use crate::value::Instant;
use crate::wrench::{Free, Wrench};
use partita_math::dense;
use partita_math::spatial::{Space, Vec3};
use partita_math::tolerance;
use partita_system::reduction;
use partita_system::SystemError;

/// A motion and multipliers, whose reactions are requested.
struct Cause<'a, G: Space> {
    vdot: &'a [f64],
    lambda: &'a [f64],
    /// Whether gravity, velocity terms and applied loads are included.
    whole: bool,
    /// Applied loads besides.
    application: Option<&'a ForceApplication<G>>,
}

/// The friction of an entry.
fn friction<'a, G: Space>(tree: &'a Mechanics<G>, entry: &ReactionFriction) -> Option<Followed<'a, G>> {
    tree.elements.get(entry.element).and_then(Followed::of)
}

/// Number of its forces: those across the axis, and those along and about it where it slides on them.
fn terms<S>(bearing: &Bearing<S>, turn: bool) -> usize {
    let across = if bearing.length.is_some() { 2 } else { 1 };
    across + usize::from(if turn { bearing.collar.is_some() } else { bearing.radius.is_some() })
}

impl Following {
    /// Magnitudes at the last twists, the forces without them gathered; stores them in the scratch memory and adds
    /// their loads.
    pub(super) fn magnitudes<G: Space<S = f64>>(
        &self,
        model: &Evaluator<f64>,
        tree: &Mechanics<G>,
        at: &Instant<f64>,
        s: &mut TreeScratch<G>,
        memory: &mut ForceScratch<G>,
        x: &mut Hold,
    ) -> Result<(), SystemError> {
        let (n, m, k) = (tree.nv, self.pattern.rows, self.frictions.len());
        self.fit(tree, n, m, k, x);
        tree.close(s, &mut x.phi, &mut x.c);
        tree.hold(at, s, &mut memory.plain, &mut x.phi, &mut x.c, &mut x.a)?;
        tree.bias(s, &mut x.b);
        tree.hold_rates(at, s, &mut memory.plain, &mut x.b)?;
        tree.mass_matrix(s, &mut x.mass);
        tree.forces(s, &mut x.y[..n]);
        for (j, entry) in self.frictions.iter().enumerate() {
            let Some(Followed { load, law, bearing }) = friction(tree, entry) else { continue };
            let now = At { tree, s, instant: again(at) };
            let read = load.read(&now);
            x.magnitudes.kappa[j] =
                law.law(bearing.coefficient, bearing.held).per_speed(read.rate * read.rate) * read.rate;
            let arm = if entry.turn { bearing.radius.unwrap_or_default() } else { 1.0 };
            x.magnitudes.base[j] = bearing.preload * arm;
            let unit = load.application(&now, &read, 1.0);
            pull(tree, s, &unit, &mut x.y[(j + 1) * n..(j + 2) * n]);
        }
        if self.short_of_mass {
            self.heavier(model, n, m, x);
        }
        let rank = self.eliminate(model, at.t, n, m, x)?;
        for column in 0..=k {
            self.answer(n, m, rank, column, x);
            let unit = match column.checked_sub(1).and_then(|j| self.frictions.get(j)) {
                Some(entry) => friction(tree, entry).map(|Followed { load, .. }| {
                    let now = At { tree, s, instant: again(at) };
                    load.application(&now, &load.read(&now), 1.0)
                }),
                None => None,
            };
            let y = &x.y[column * n..(column + 1) * n];
            let cause = Cause { vdot: y, lambda: &x.lambda, whole: column == 0, application: unit.as_ref() };
            self.transmit(model, tree, at, s, &cause, &mut x.conditions)?;
            self.press(model, tree, s, (&x.lambda, &x.conditions), |t, of, weight, force| {
                match column.checked_sub(1) {
                    None => x.magnitudes.terms[t] = Term { of, weight, a: force },
                    Some(j) => x.magnitudes.b[t * k + j] = force,
                }
            });
        }
        for dropped in rank..m {
            self.self_stress(m, rank, dropped, x);
            let cause = Cause { vdot: &x.still, lambda: &x.lambda, whole: false, application: None };
            let largest = self.transmit(model, tree, at, s, &cause, &mut x.conditions)?;
            let mut felt = None;
            self.press(model, tree, s, (&x.lambda, &x.conditions), |_, of, _, force| {
                if Vec3(force).norm() > tolerance::TAKES_PART * largest {
                    felt = Some(of);
                }
            });
            if let Some(entry) = felt.and_then(|i| self.frictions.get(i)) {
                return Err(SystemError::OpenReaction {
                    friction: entry.name.as_str().into(),
                    joint: entry.joint.as_str().into(),
                    t: at.t,
                });
            }
        }
        x.magnitudes.solve().map_err(|jam| self.jammed(tree, at.t, jam))?;
        self.add_given(tree, at, s, memory, &x.magnitudes.normal);
        Ok(())
    }

    /// Add their loads with these normal forces, at the last twists; stores them in the memory of the forces.
    pub(super) fn add_given<G: Space<S = f64>>(
        &self,
        tree: &Mechanics<G>,
        at: &Instant<f64>,
        s: &mut TreeScratch<G>,
        memory: &mut ForceScratch<G>,
        normal: &[f64],
    ) {
        for (j, entry) in self.frictions.iter().enumerate() {
            let Some(Followed { load, law, bearing }) = friction(tree, entry) else { continue };
            memory.normal_forces[j] = normal[j];
            let now = At { tree, s, instant: again(at) };
            let read = load.read(&now);
            let kappa = law.law(bearing.coefficient, bearing.held).per_speed(read.rate * read.rate) * read.rate;
            let effort = -(kappa * normal[j]);
            let application = load.application(&now, &read, effort);
            let effect = Effect { application, potential: 0.0, power: effort * read.rate };
            tree.add_effect(s, &effect, memory);
        }
    }

    fn jammed<G: Space<S = f64>>(&self, tree: &Mechanics<G>, t: f64, jam: Jam) -> SystemError {
        let Some(entry) = self.frictions.get(jam.which) else { return SystemError::Unchosen("friction") };
        let coefficient = friction(tree, entry).map_or(f64::NAN, |x| x.bearing.coefficient.max(x.bearing.held));
        SystemError::Jammed {
            friction: entry.name.as_str().into(),
            joint: entry.joint.as_str().into(),
            coefficient,
            returned: jam.returned,
            several: self.frictions.len() > 1,
            t,
        }
    }

    /// Memory for everything; nothing grows after the first time.
    fn fit<G: Space<S = f64>>(&self, tree: &Mechanics<G>, n: usize, m: usize, k: usize, x: &mut Hold) {
        for (x, size) in [
            (&mut x.phi, m),
            (&mut x.c, self.pattern.nnz()),
            (&mut x.a, m),
            (&mut x.b, m),
            (&mut x.mass, n * n),
            (&mut x.y, n * (k + 1)),
            (&mut x.w, n * m),
            (&mut x.scale, m),
            (&mut x.gram, m * m),
            (&mut x.x, m),
            (&mut x.lambda, m),
            (&mut x.still, n),
            (&mut x.conditions.own, n),
        ] {
            x.resize(size, 0.0);
        }
        x.perm.resize(m, 0);
        x.conditions.wrenches.resize(k, Wrench::default());
        let of = |g: &ReactionFriction| friction(tree, g).map_or(0, |x| terms(x.bearing, g.turn));
        x.magnitudes.fit(k, self.frictions.iter().map(of).sum());
    }

    /// Whether a row of C is round-off alone for these displacements of the velocities.
    fn is_round_off(&self, displacement: &[f64], row: usize, c: &[f64]) -> bool {
        let strength = |large: f64| reduction::strength(&self.pattern, c, displacement, row, large);
        self.row_displacement[row].is_some_and(|large| reduction::is_round_off(strength(large)))
    }

    /// `M + Cᵀ W C` and `h − Cᵀ W b` where M alone is singular: neither v' nor λ changes.
    fn heavier(&self, model: &Evaluator<f64>, n: usize, m: usize, x: &mut Hold) {
        let displacement = &model.callers.v_sizes;
        let size = (0..n).fold(0.0f64, |s, i| s.max(x.mass[i * n + i] * displacement[i] * displacement[i]));
        for row in 0..m {
            let entries = || self.pattern.row(row).map(|e| (self.pattern.col_idx[e], x.c[e]));
            let length: f64 = entries().map(|(i, c)| (c * displacement[i]).powi(2)).sum();
            if length <= 0.0 || self.is_round_off(displacement, row, &x.c) {
                continue;
            }
            let weight = size / length;
            for (i, c) in entries() {
                x.y[i] -= weight * c * x.b[row];
                for (j, d) in entries() {
                    x.mass[i * n + j] += weight * c * d;
                }
            }
        }
    }

    /// M and the rows of C factored, the right-hand sides brought into the mass metric; the rank of C.
    fn eliminate(
        &self,
        model: &Evaluator<f64>,
        t: f64,
        n: usize,
        m: usize,
        x: &mut Hold,
    ) -> Result<usize, SystemError> {
        if !x.c.iter().chain(&x.y).all(|x| x.is_finite()) {
            return Err(SystemError::NotFinite { what: "what a friction depends on".into(), t });
        }
        dense::cholesky(&mut x.mass, n).map_err(|e| SystemError::Mass {
            name: model.placed.velocity_names.get(e.index).cloned().unwrap_or_default(),
            pivot: e.pivot,
        })?;
        for y in x.y.chunks_exact_mut(n) {
            dense::cholesky_forward(&x.mass, n, y);
        }
        for row in 0..m {
            let w = &mut x.w[row * n..(row + 1) * n];
            w.fill(0.0);
            for e in self.pattern.row(row) {
                w[self.pattern.col_idx[e]] = x.c[e];
            }
            dense::cholesky_forward(&x.mass, n, w);
            let length = dense::dot(w, w).sqrt();
            let empty = length <= 0.0 || self.is_round_off(&model.callers.v_sizes, row, &x.c);
            x.scale[row] = if empty { 0.0 } else { 1.0 / length };
            w.iter_mut().for_each(|w| *w *= x.scale[row]);
        }
        for i in 0..m {
            for j in 0..=i {
                x.gram[i * m + j] = dense::dot(&x.w[i * n..(i + 1) * n], &x.w[j * n..(j + 1) * n]);
            }
        }
        Ok(dense::pivoted_cholesky(&mut x.gram, m, m, self.dependent, &mut x.perm))
    }

    /// v' (in its column of y) and λ of one right-hand side.                                  (G2)
    fn answer(&self, n: usize, m: usize, rank: usize, column: usize, x: &mut Hold) {
        let y = &mut x.y[column * n..(column + 1) * n];
        for p in 0..rank {
            let row = x.perm[p];
            let own = if column == 0 { x.b[row] * x.scale[row] } else { 0.0 };
            let known = dense::dot(&x.gram[p * m..p * m + p], &x.x[..p]);
            x.x[p] = (-(dense::dot(&x.w[row * n..(row + 1) * n], y) + own) - known) / x.gram[p * m + p];
        }
        back(&x.gram, m, rank, &mut x.x);
        x.lambda.fill(0.0);
        for p in 0..rank {
            let row = x.perm[p];
            x.lambda[row] = x.x[p] * x.scale[row];
            dense::axpy(x.x[p], &x.w[row * n..(row + 1) * n], y);
        }
        dense::cholesky_backward(&x.mass, n, y);
    }

    /// Multipliers that balance each other: 1 (in scales) for a row that was dropped.
    fn self_stress(&self, m: usize, rank: usize, dropped: usize, x: &mut Hold) {
        for p in 0..rank {
            x.x[p] = -x.gram[dropped * m + p];
        }
        back(&x.gram, m, rank, &mut x.x);
        x.lambda.fill(0.0);
        for p in 0..rank {
            x.lambda[x.perm[p]] = x.x[p] * x.scale[x.perm[p]];
        }
        let row = x.perm[dropped];
        // a zero row constrains nothing
        x.lambda[row] = if x.scale[row] > 0.0 { x.scale[row] } else { 1.0 };
    }

    /// Load that the joint of each link transmits to it, left in the second half of `partial`; the largest load of a loop
    /// closure or a condition, moments over the size of bodies. Loads of joints' own conditions and drives are reactions
    /// too, and are left beside.
    fn transmit<G: Space<S = f64>>(
        &self,
        model: &Evaluator<f64>,
        tree: &Mechanics<G>,
        at: &Instant<f64>,
        s: &mut TreeScratch<G>,
        cause: &Cause<G>,
        conditions: &mut OfConditions,
    ) -> Result<f64, SystemError> {
        conditions.own.fill(0.0);
        conditions.wrenches.fill(Wrench::default());
        let n = tree.links.len();
        let mut memory = scratch_of(tree, s);
        let (acceleration, wrench) = memory.split_at_mut(n);
        acceleration[0] = Default::default();
        wrench[..n].fill(Default::default());
        for i in 1..n {
            let (w, u) = acceleration[tree.links[i].parent];
            acceleration[i] = tree.propagate(i, s, w, u, |v| cause.vdot[v]);
            let (link, x) = (&tree.links[i], &s.links[i]);
            let (alpha, acc) = acceleration[i];
            wrench[i] = if cause.whole {
                let force = G::scale(x.acc + acc - tree.gravity, link.mass) - x.force;
                let turning = G::cross_ang(x.w, G::spin(&x.inertia, x.w));
                (G::spin(&x.inertia, x.alpha + alpha) + turning - x.moment, force)
            } else {
                (G::spin(&x.inertia, alpha), G::scale(acc, link.mass))
            };
        }
        if let Some(application) = cause.application {
            each(application, |p| add_wrench::<G>(wrench, p, -1.0));
        }
        let (length, mut largest) = (model.placed.length, 0.0f64);
        let size =
            |moment: G::Ang, force: G::Vec| G::dot(force, force).sqrt().max(G::dot_ang(moment, moment).sqrt() / length);
        for k in &tree.closings {
            let (moment, force) = tree.closing_wrench(k, s, cause.lambda);
            largest = largest.max(size(moment, force));
        }
        tree.closing_wrenches(s, cause.lambda, |link, moment, force| {
            wrench[link].0 -= moment;
            wrench[link].1 -= force;
        });
        for c in &tree.conditions {
            let joint = model.joint_of(c.owner);
            let OfConditions { own, wrenches } = &mut *conditions;
            let along = |v: usize, x: f64| {
                if joint.is_some() {
                    own[v] += x;
                }
            };
            let put = |x: f64, pushed: &crate::coupling::Pushed<G>| {
                let (moment, force) = (G::scale_ang(pushed.unit.moment, x), G::scale(pushed.unit.force, x));
                largest = largest.max(size(moment, force));
                for (node, sign) in [(pushed.nodes[1], -1.0), (pushed.nodes[0], 1.0)] {
                    let link = model.placed.link_of(node);
                    let arm = pushed.unit.in_world - tree.reference_point(link, s);
                    wrench[link].0 += G::scale_ang(moment + G::moment(arm, force), sign);
                    wrench[link].1 += G::scale(force, sign);
                }
                let on_child = Wrench { moment: G::ang_to(moment), force: G::vec_to(force) };
                let about_origin = on_child.about(G::vec_to(pushed.unit.in_world));
                let of = self.frictions.iter().zip(wrenches.iter_mut()).filter(|(f, _)| Some(f.number) == joint);
                of.for_each(|(_, w)| w.add(&about_origin));
            };
            c.apply(tree, s, at, &cause.lambda[c.row..c.row + c.rows()], put, along)?;
        }
        for i in (1..n).rev() {
            let (moment, force) = wrench[i];
            let parent = tree.links[i].parent;
            let at_parent = tree.to_parent(i, s, moment, force);
            wrench[parent].0 += at_parent;
            wrench[parent].1 += force;
        }
        s.partial = memory;
        Ok(largest)
    }

    /// The forces that determine each friction at the reactions last found: `put(term, friction, arm, force)`.
    fn press<G: Space<S = f64>>(
        &self,
        model: &Evaluator<f64>,
        tree: &Mechanics<G>,
        s: &TreeScratch<G>,
        (lambda, conditions): (&[f64], &OfConditions),
        mut put: impl FnMut(usize, usize, f64, [f64; 3]),
    ) {
        let links = tree.links.len();
        let mut t = 0;
        for (i, entry) in self.frictions.iter().enumerate() {
            let Some(Followed { bearing, .. }) = friction(tree, entry) else { continue };
            let zero = model.numbers.joints[entry.number].1 - model.numbers.reference[entry.child];
            let point = tree.reference_point(entry.child, s) + G::rotate(&s.links[entry.child].rot, G::vec_in(zero));
            let (axis, reaction) = match entry.read {
                Read::Tree { outer, moved } => {
                    let (moment, force) = s.partial[links + outer];
                    let about = moment + G::moment(tree.reference_point(outer, s) - point, force);
                    let axis = |turn: bool, link: usize| {
                        let x = &s.links[link];
                        if turn {
                            G::ang_to(x.axis)
                        } else {
                            G::vec_to(x.direction)
                        }
                    };
                    let mut free = [(false, Vec3::zero()); 6];
                    let several = free.iter_mut().zip(&entry.free);
                    several.for_each(|(free, &(turn, link))| *free = (turn, axis(turn, link)));
                    let passed = Wrench { moment: G::ang_to(about), force: G::vec_to(force) };
                    // of the efforts there those of the joint's own conditions and drives are reactions
                    let own = |i: usize| conditions.own[tree.links[entry.free[i].1].v];
                    (axis(entry.turn, moved), Free::new(&free[..entry.free.len()]).with_along(&passed, own))
                }
                Read::Cut { closing, link, axis } => {
                    let (moment, force) = tree.closing_wrench(&tree.closings[closing], s, lambda);
                    let rot = G::rot_to(&s.links[link].rot);
                    let mut whole = Wrench { moment: G::ang_to(moment), force: G::vec_to(force) };
                    whole.add(&conditions.wrenches[i].about(-G::vec_to(point)));
                    (rot.apply(axis), whole)
                }
            };
            let Wrench { moment, force } = reaction;
            let across = |x: Vec3<f64>| x - axis.times(axis.dot(x));
            let arm = if entry.turn { bearing.radius.unwrap_or_default() } else { 1.0 };
            let mut give = |weight: f64, force: Vec3<f64>| {
                put(t, i, weight, force.0);
                t += 1;
            };
            match bearing.length {
                // two short bearings at the ends share the force and take the moment as a couple
                Some(length) => {
                    let (half, couple) = (across(force).times(0.5), moment.cross(axis).times(1.0 / length));
                    give(arm, half + couple);
                    give(arm, half - couple);
                }
                None => give(arm, across(force)),
            }
            match (entry.turn, bearing.collar, bearing.radius) {
                (true, Some(collar), _) => give(collar, axis.times(axis.dot(force))),
                (false, _, Some(radius)) => give(1.0 / radius, axis.times(axis.dot(moment))),
                _ => {}
            }
        }
    }
}

/// `x ← L⁻ᵀ x` for the first `rank` columns of a factor with rows of m.
fn back(factor: &[f64], m: usize, rank: usize, x: &mut [f64]) {
    for p in (0..rank).rev() {
        let known: f64 = (p + 1..rank).map(|i| factor[i * m + p] * x[i]).sum();
        x[p] = (x[p] - known) / factor[p * m + p];
    }
}

fn again<'a>(at: &Instant<'a, f64>) -> Instant<'a, f64> {
    Instant { t: at.t, q: at.q, v: at.v, callers: at.callers, uncounted: at.uncounted }
}

/// Component of the load along all velocities.
fn pull<G: Space<S = f64>>(
    tree: &Mechanics<G>,
    s: &mut TreeScratch<G>,
    application: &ForceApplication<G>,
    out: &mut [f64],
) {
    out.fill(0.0);
    if let ForceApplication::Along(v, effort) = application {
        out[*v] = *effort;
        return;
    }
    let n = tree.links.len();
    let mut memory = scratch_of(tree, s);
    let wrench = &mut memory[n..2 * n];
    wrench.fill(Default::default());
    each(application, |p| add_wrench::<G>(wrench, p, 1.0));
    for i in (1..n).rev() {
        let (moment, force) = wrench[i];
        tree.along(i, s, moment, force, |v, x| out[v] = x);
        let parent = tree.links[i].parent;
        let at_parent = tree.to_parent(i, s, moment, force);
        wrench[parent].0 += at_parent;
        wrench[parent].1 += force;
    }
    s.partial = memory;
}

fn each<G: Space>(application: &ForceApplication<G>, mut put: impl FnMut(&AppliedWrench<G>)) {
    match application {
        ForceApplication::On(p) => put(p),
        ForceApplication::Between(p, other) => {
            put(p);
            put(other);
        }
        ForceApplication::Along(..) | ForceApplication::Listed => {}
    }
}

fn add_wrench<G: Space<S = f64>>(wrench: &mut [(G::Ang, G::Vec)], p: &AppliedWrench<G>, sign: f64) {
    wrench[p.link].0 += G::scale_ang(p.moment + G::moment(p.arm, p.force), sign);
    wrench[p.link].1 += G::scale(p.force, sign);
}

fn scratch_of<G: Space<S = f64>>(tree: &Mechanics<G>, s: &mut TreeScratch<G>) -> Vec<(G::Ang, G::Vec)> {
    let mut memory = std::mem::take(&mut s.partial);
    if memory.len() < 2 * tree.links.len() {
        memory.resize(2 * tree.links.len(), Default::default()); // at set-up; later the room is there
    }
    memory
}
