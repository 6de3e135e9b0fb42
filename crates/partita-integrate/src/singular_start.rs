//! The first step out of a singular position, along the branch that the velocities there single out.
//!
//! The motion along a branch is smooth, but in the position itself nothing can be evaluated: C has lost a rank. Gauss
//! collocation has no node at its ends, and its polynomial goes through the start all the same:
//!
//! ```text
//! q(t₀ + c_i h) = q₀ + h Σ a_ij q'_j,   u(t₀ + c_i h) = u₀ + h Σ a_ij u'_j,   (q', u')_i = f(t₀ + c_i h, q_i, u_i)
//! ```
//!
//! u are independent velocities of a choice that is good a little along the branch. At every node the loops are closed
//! next to the prediction, which stays on the branch, and the equations are the ordinary ones there. The stages are
//! found by iteration with Anderson's extrapolation: where branches form a cone its curvature grows as one over the
//! distance, and plain iteration need not contract, however short the step. The step is taken with two numbers of nodes
//! and shortened until both agree.

use partita_math::dense::Matrix;
use partita_math::factor::least_squares_min_norm;
use partita_math::tolerance;
use partita_system::manifold::kept_rows::close_kept;
use partita_system::record::Output;
use partita_system::reduction::Reduction;
use partita_system::start::choose_partition;
use partita_system::{ConstrainedSystem, SystemError, SystemRef};

/// Collocation is settled below this. Scale: fraction of the agreement asked for. Reason: the iteration adds no error
/// that is seen.
const START_SETTLED: f64 = 1e-3;
/// No tolerance of a singular start is looser. Unit: relative tolerance. Reason: the branch must be identified
/// reliably.
const LOOSEST_START: f64 = 1e-4;
/// Move of the fastest velocity in the first step that is tried. Unit: characteristic displacement (a radian). Reason:
/// about half of what a crossing step takes.
const START_MOVE: f64 = 0.4;
/// The shortest step that is tried. Scale: characteristic displacement. Reason: at its end rounding, over the square of
/// the distance, is 1e-10.
const LEAST_START_MOVE: f64 = 1e-3;
/// Halvings of the step.
const HALVINGS: usize = 24;
/// Nodes: of the step that is taken, of the other one.
const NODES: (usize, usize) = (10, 8);
/// Two solutions of a singular start may differ by this. Scale: fraction of the tolerance. Reason: the start adds no
/// error that is seen.
const START_AGREEMENT: f64 = 0.1;
/// No tolerance of a singular start is tighter. Unit: relative tolerance. Reason: rounding in evaluations near the
/// position.
const TIGHTEST_START: f64 = 1e-11;
/// Iterations, and how many of them the extrapolation remembers.
const ITERATIONS: usize = 60;
const REMEMBERED: usize = 12;
/// Velocities through the nodes lead back to those of the start within this. Scale: fraction of the fastest. Reason: on
/// another branch they differ by about their own size.
const LEADS_BACK: f64 = 1e-3;
/// Smaller initial velocities do not determine the branch. Scale: fraction of the velocities reached. Reason:
/// the accelerations decide then.
const SLOW_START: f64 = 1e-3;
/// Accelerations through the nodes are those of the branch within this. Scale: fraction of them and of the square of
/// the rates. Reason: on another branch they differ by about their own size.
const START_BENDS: f64 = 0.05;
/// Part of the step over which the polynomial is differentiated. Unit: fraction of the step. Reason: short against the
/// motion, long against rounding.
const START_BESIDE: f64 = 1e-3;
const SHIFTS: usize = 4;

/// The step that was taken.
pub struct SingularStep<'s, S: ConstrainedSystem> {
    r: Reduction<'s, S>,
    start: (f64, Vec<f64>, Vec<f64>),
    nodes: Nodes,
    h: f64,
    stages: Stages,
    /// Distance from singularity at the end.
    distance: f64,
    /// End of the step.
    pub t: f64,
    /// Coordinates there.
    pub q: Vec<f64>,
    /// Velocities there.
    pub v: Vec<f64>,
    /// Work of non-conservative forces and of driven constraints in the step.
    pub work: f64,
    /// Distance by which the start was moved onto the branch, in characteristic displacements.
    pub moved: f64,
    /// Difference between the two computations of the step, as a fraction of the motion.
    pub error: f64,
    /// Whether this exceeds the requested accuracy.
    pub lenient: bool,
    /// Evaluations of the equations, those of steps that were too long included.
    pub evaluations: u64,
}

/// Solution at each node.
#[derive(Default)]
struct Stages {
    /// q' and u', node by node.
    rates: Vec<f64>,
    /// What closing added at the last node.
    shift: Vec<f64>,
    v: Vec<Vec<f64>>,
    power: Vec<f64>,
}

/// Gauss nodes on 0..1 with the coefficients of collocation.
#[derive(Clone)]
struct Nodes {
    c: Vec<f64>,
    /// Barycentric weights.
    w: Vec<f64>,
    /// Weights of the quadrature.
    b: Vec<f64>,
    /// The row of each node.
    a: Vec<Vec<f64>>,
}

impl Nodes {
    fn new(s: usize) -> Self {
        // roots of the Legendre polynomial by Newton's method, its weights by its slope
        let legendre = |x: f64| {
            let (mut before, mut p) = (1.0, x);
            for n in 1..s {
                let m = n as f64;
                (before, p) = (p, ((2.0 * m + 1.0) * x * p - m * before) / (m + 1.0));
            }
            (p, s as f64 * (x * p - before) / (x * x - 1.0))
        };
        let (mut c, mut b) = (Vec::new(), Vec::new());
        for i in 0..s {
            let mut x = -(std::f64::consts::PI * (i as f64 + 0.75) / (s as f64 + 0.5)).cos();
            for _ in 0..20 {
                let (p, slope) = legendre(x);
                x -= p / slope;
            }
            let slope = legendre(x).1;
            c.push(0.5 * (1.0 + x));
            b.push(1.0 / ((1.0 - x * x) * slope * slope));
        }
        let w =
            (0..s).map(|i| 1.0 / (0..s).filter(|&j| j != i).map(|j| 4.0 * (c[i] - c[j])).product::<f64>()).collect();
        let mut nodes = Self { c, w, b, a: Vec::new() };
        nodes.a = (0..s).map(|i| nodes.integrals(nodes.c[i])).collect();
        nodes
    }

    fn count(&self) -> usize {
        self.c.len()
    }

    /// Lagrange polynomials of the nodes at x.
    fn values(&self, x: f64) -> Vec<f64> {
        if let Some(i) = self.c.iter().position(|c| *c == x) {
            return (0..self.count()).map(|j| if j == i { 1.0 } else { 0.0 }).collect();
        }
        let parts: Vec<f64> = self.c.iter().zip(&self.w).map(|(c, w)| w / (x - c)).collect();
        let sum: f64 = parts.iter().sum();
        parts.iter().map(|p| p / sum).collect()
    }

    /// Their integrals from 0 to x, exact by the quadrature of the nodes.
    fn integrals(&self, x: f64) -> Vec<f64> {
        let mut sum = vec![0.0; self.count()];
        for (c, b) in self.c.iter().zip(&self.b) {
            sum.iter_mut().zip(self.values(x * c)).for_each(|(s, l)| *s += x * b * l);
        }
        sum
    }
}

fn fastest<S: ConstrainedSystem>(system: &S, v: &[f64]) -> f64 {
    v.iter().enumerate().fold(0.0, |m: f64, (i, v)| m.max(v.abs() / system.characteristic_displacement(i)))
}

/// The loops closed next to q, the coordinates of independent velocities kept. False where they do not close.
fn close<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &mut [f64]) -> Result<bool, SystemError> {
    r.system.normalise(q);
    Ok(close_kept(r, t, q)?.is_closed())
}

/// Last differences of an iteration, to extrapolate from.
#[derive(Default)]
struct Anderson {
    last: Option<(Vec<f64>, Vec<f64>)>,
    steps: Vec<(Vec<f64>, Vec<f64>)>,
}

impl Anderson {
    /// The next iterate after `x`, where the plain iteration gives `x + f`.
    fn next(&mut self, x: &[f64], f: &[f64]) -> Vec<f64> {
        let minus = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a - b).collect() };
        if let Some((x0, f0)) = &self.last {
            self.steps.push((minus(x, x0), minus(f, f0)));
            if self.steps.len() > REMEMBERED {
                self.steps.remove(0);
            }
        }
        self.last = Some((x.to_vec(), f.to_vec()));
        let mut next: Vec<f64> = x.iter().zip(f).map(|(x, f)| x + f).collect();
        let mut slopes = Matrix::new(f.len(), self.steps.len());
        for (j, (_, df)) in self.steps.iter().enumerate() {
            df.iter().enumerate().for_each(|(i, d)| slopes[(i, j)] = *d);
        }
        if self.steps.is_empty() {
            return next;
        }
        if let Ok((parts, _)) = least_squares_min_norm(&slopes, f, tolerance::NULL_VALUE) {
            for (part, (dx, df)) in parts.iter().zip(&self.steps) {
                next.iter_mut().zip(dx.iter().zip(df)).for_each(|(n, (x, f))| *n -= part * (x + f));
            }
        }
        next
    }
}

/// One attempt at a length.
struct Attempt<'a, 's, S: ConstrainedSystem> {
    r: &'a mut Reduction<'s, S>,
    start: (f64, &'a [f64], &'a [f64]),
    h: f64,
    /// What the iteration is to come to rest within, in parts of the motion.
    tolerance: f64,
    evaluations: u64,
}

impl<S: ConstrainedSystem> Attempt<'_, '_, S> {
    /// Natural sizes of q' and u' of one node: their fastest rate, and that over the step.
    fn scales(&self, speed: f64) -> Vec<f64> {
        let system = self.r.system.clone();
        let mut of_q = vec![speed; system.size().nq];
        for i in 0..system.size().nv {
            for c in system.coordinates_of(i) {
                of_q[c] = speed
                    * if system.coordinates_of(i).len() == 1 { system.characteristic_displacement(i) } else { 1.0 };
            }
        }
        of_q.extend(
            self.r.partition.independent.iter().map(|&i| speed / self.h * system.characteristic_displacement(i)),
        );
        of_q
    }

    /// Rates at all nodes; none where they are not found.
    fn solve(&mut self, nodes: &Nodes, first: &[f64]) -> Result<Option<Stages>, SystemError> {
        let (q0, v0) = (self.start.1, self.start.2);
        let system = self.r.system.clone();
        let mut qdot = vec![0.0; q0.len()];
        // the prediction uses the initial velocities and the accelerations next to the start
        let mut x = Vec::new();
        for c in &nodes.c {
            let v: Vec<f64> = v0.iter().zip(first).map(|(v, a)| v + c * self.h * a).collect();
            system.rate(q0, &v, &mut qdot);
            x.extend_from_slice(&qdot);
            x.extend(self.r.partition.independent.iter().map(|&i| first[i]));
        }
        let scales = self.scales(fastest(&*system, v0) + self.h * fastest(&*system, first));
        self.iterate(nodes, x, &scales)
    }

    /// The positions that follow from the rates `x` at the nodes; none where the loops do not close.
    fn sweep(&mut self, nodes: &Nodes, x: &[f64]) -> Result<Option<Stages>, SystemError> {
        let (t, q0, v0) = self.start;
        let (nq, s) = (q0.len(), nodes.count());
        let u0: Vec<f64> = self.r.partition.independent.iter().map(|&i| v0[i]).collect();
        let width = nq + u0.len();
        let mut vdot = vec![0.0; v0.len()];
        let mut stages = Stages { rates: vec![0.0; s * width], ..Stages::default() };
        for i in 0..s {
            let at = t + nodes.c[i] * self.h;
            let (mut q, mut u) = (q0.to_vec(), u0.clone());
            for (a, rates) in nodes.a[i].iter().zip(x.chunks_exact(width)) {
                q.iter_mut().zip(&rates[..nq]).for_each(|(q, d)| *q += self.h * a * d);
                u.iter_mut().zip(&rates[nq..]).for_each(|(u, d)| *u += self.h * a * d);
            }
            let predicted = q.clone();
            if !close(self.r, at, &mut q)? {
                return Ok(None);
            }
            stages.shift = q.iter().zip(&predicted).map(|(q, p)| q - p).collect();
            self.r.evaluate(at, &q, &u)?;
            self.evaluations += 1;
            self.r.full_acceleration(&mut vdot);
            let to = &mut stages.rates[i * width..(i + 1) * width];
            self.r.system.rate(&q, &self.r.v, &mut to[..nq]);
            to[nq..].iter_mut().zip(&self.r.partition.independent).for_each(|(to, &i)| *to = vdot[i]);
            stages.v.push(self.r.v.clone());
            stages.power.push(self.power(at, &q, &vdot)?);
        }
        Ok(Some(stages))
    }

    /// The extrapolated iteration from x.
    fn iterate(&mut self, nodes: &Nodes, mut x: Vec<f64>, scales: &[f64]) -> Result<Option<Stages>, SystemError> {
        let width = scales.len();
        let mut anderson = Anderson::default();
        let (mut least, mut since) = (f64::INFINITY, 0);
        for _ in 0..ITERATIONS {
            let Some(stages) = self.sweep(nodes, &x)? else { return Ok(None) };
            let off: Vec<f64> =
                stages.rates.iter().zip(&x).enumerate().map(|(e, (n, x))| (n - x) / scales[e % width]).collect();
            // the error at a node counts by its weight: the first one is next to the singular position, where rounding
            // is largest
            let worst = off.chunks_exact(width.max(1)).zip(&nodes.b).fold(0.0, |m: f64, (off, b)| {
                off.iter().fold(m, |m, o| if o.is_nan() { f64::INFINITY } else { m.max(b * o.abs()) })
            });
            if !worst.is_finite() {
                return Ok(None);
            }
            // at rest up to rounding; the other nodes show whether this suffices
            since = if worst < 0.5 * least { 0 } else { since + 1 };
            least = least.min(worst);
            if worst <= START_SETTLED * self.tolerance
                || (worst <= tolerance::SINGULAR_LENIENCE * self.tolerance && since > 3)
            {
                return Ok(Some(stages));
            }
            if since > 12 {
                return Ok(None);
            }
            let here: Vec<f64> = x.iter().enumerate().map(|(e, x)| x / scales[e % width]).collect();
            let next = anderson.next(&here, &off);
            x = next.iter().enumerate().map(|(e, x)| x * scales[e % width]).collect();
        }
        Ok(None)
    }

    /// dE/dt that is not the work of conservative forces, at the point last evaluated.
    fn power(&mut self, t: f64, q: &[f64], vdot: &[f64]) -> Result<f64, SystemError> {
        let r = &mut *self.r;
        let mut power = 0.0;
        if r.system.has_power() {
            power += r.system.power(t, q, &r.v, &mut r.scratch)?;
        }
        if r.system.rheonomic() {
            let mut residual = vec![0.0; vdot.len()];
            r.system.inverse_dynamics(t, q, &r.v, vdot, &mut r.scratch, &mut residual)?;
            power += residual.iter().zip(&r.gamma).map(|(x, g)| x * g).sum::<f64>();
        }
        Ok(power)
    }
}

/// q, u and work of the polynomial at the part x of the step.
fn at(nodes: &Nodes, h: f64, stages: &Stages, q0: &[f64], u0: &[f64], x: f64) -> (Vec<f64>, Vec<f64>, f64) {
    let (mut q, mut u, mut work) = (q0.to_vec(), u0.to_vec(), 0.0);
    let width = q0.len() + u0.len();
    for (i, weight) in nodes.integrals(x).into_iter().enumerate() {
        let rates = &stages.rates[i * width..(i + 1) * width];
        q.iter_mut().zip(rates).for_each(|(q, d)| *q += h * weight * d);
        u.iter_mut().zip(&rates[q0.len()..]).for_each(|(u, d)| *u += h * weight * d);
        work += h * weight * stages.power[i];
    }
    (q, u, work)
}

/// Velocities of the polynomial through those at the nodes.
fn velocities(nodes: &Nodes, stages: &Stages, x: f64) -> Vec<f64> {
    let mut v = vec![0.0; stages.v[0].len()];
    for (weight, of) in nodes.values(x).into_iter().zip(&stages.v) {
        v.iter_mut().zip(of).for_each(|(v, o)| *v += weight * o);
    }
    v
}

/// The first step from the singular (t, q) with the velocities v, that lie on one branch, and the accelerations with
/// which it leaves as far as they are known; C has `rank` next to it. It ends at `limit` at the latest and is exact to
/// a tenth of the relative `tolerance`.
///
/// # Errors
/// `SingularStart` where no step was found; what failed last where something could not be evaluated.
pub fn singular_step<'s, S: ConstrainedSystem>(
    system: impl Into<SystemRef<'s, S>>,
    rank: usize,
    (t, q, v): (f64, &[f64], &[f64]),
    leaving: Option<&[f64]>,
    (limit, tolerance): (f64, f64),
) -> Result<SingularStep<'s, S>, SystemError> {
    let system = system.into();
    let tolerance = START_AGREEMENT * tolerance.clamp(TIGHTEST_START, LOOSEST_START);
    let speed = fastest(&*system, v);
    // v h + a h^2 / 2 = START_MOVE
    let strong = leaving.map_or(0.0, |a| fastest(&*system, a));
    let mut h = (2.0 * START_MOVE / (speed + (speed * speed + 2.0 * START_MOVE * strong).sqrt())).min(limit - t);
    let mut evaluations = 0;
    let mut why = String::from("the loops did not close along it");
    let (taken, other) = (Nodes::new(NODES.0), Nodes::new(NODES.1));
    let (mut best, mut worse): (Option<SingularStep<S>>, usize) = (None, 0);
    for _ in 0..HALVINGS {
        let whole = h == limit - t;
        match attempt(system.clone(), rank, (t, q, v), leaving, h, tolerance, (&taken, &other), &mut evaluations) {
            Ok(Ok(mut found)) => {
                if whole {
                    found.t = limit; // not a rounding error before it
                }
                if best.as_ref().is_none_or(|best| found.error < best.error) {
                    (best, worse) = (Some(found), 0);
                } else {
                    worse += 1;
                }
            }
            Ok(Err(said)) => why = said,
            Err(e) if e.is_local() => why = e.to_string(),
            Err(e) => return Err(e),
        }
        let done = best.as_ref().is_some_and(|best| best.error <= tolerance);
        h *= 0.5;
        if done || worse > 1 || h * speed < 0.1 * LEAST_START_MOVE {
            break;
        }
    }
    if let Some(best) = &best {
        why = format!("next to the position rounding leaves {:.1e} of the motion undetermined", best.error);
    }
    match best.filter(|best| best.error <= tolerance::SINGULAR_LENIENCE * tolerance) {
        Some(best) => {
            Ok(SingularStep { evaluations, error: best.error.max(0.0), lenient: best.error > tolerance, ..best })
        }
        None => Err(SystemError::SingularStart {
            t,
            message: format!(
                "the velocities lie on one branch, but no first step along it succeeded ({why}); start a little \
                 away from the position, or give a longer run or higher rates"
            ),
        }),
    }
}

fn attempt<'s, S: ConstrainedSystem>(
    system: SystemRef<'s, S>,
    rank: usize,
    (t, q, v): (f64, &[f64], &[f64]),
    leaving: Option<&[f64]>,
    h: f64,
    tolerance: f64,
    (taken, other): (&Nodes, &Nodes),
    evaluations: &mut u64,
) -> Result<Result<SingularStep<'s, S>, String>, SystemError> {
    let mut r = Reduction::dense(system.clone(), rank);
    let mut probe = q.to_vec();
    let bend = |i: usize| leaving.map_or(0.0, |a| 0.125 * h * h * a[i]);
    system.step(&mut probe, &v.iter().enumerate().map(|(i, v)| 0.5 * h * v + bend(i)).collect::<Vec<_>>());
    let t_probe = t + 0.5 * h;
    for _ in 0..2 {
        choose_partition(&mut r, t_probe, &probe, None, None)?;
        if !close(&mut r, t_probe, &mut probe)? {
            return Ok(Err("the loops did not close along it".into()));
        }
    }
    choose_partition(&mut r, t_probe, &probe, None, None)?;
    let independent = r.partition.independent.clone();
    let u0: Vec<f64> = independent.iter().map(|&i| v[i]).collect();
    r.evaluate(t_probe, &probe, &u0)?;
    let mut first = vec![0.0; v.len()];
    match leaving {
        Some(a) => first.copy_from_slice(a),
        None => r.full_acceleration(&mut first),
    }
    // a start beside the position is on no branch, or on another: what closing adds along the step is taken off at its
    // start
    let (given, mut q, mut less) = (q, q.to_vec(), None);
    for _ in 0..SHIFTS {
        let mut attempt = Attempt { r: &mut r, start: (t, &q, v), h, tolerance, evaluations: 0 };
        less = attempt.solve(other, &first)?;
        *evaluations += attempt.evaluations;
        let Some(found) = &less else { break };
        let shifted: Vec<f64> = q.iter().zip(&found.shift).map(|(q, s)| q + s).collect();
        if system_move(&*system, &q, &shifted) <= tolerance::CLOSED {
            break;
        }
        q = shifted;
        system.normalise(&mut q);
    }
    let Some(less) = less else { return Ok(Err("its collocation equations did not converge".into())) };
    let mut attempt = Attempt { r: &mut r, start: (t, &q, v), h, tolerance, evaluations: 0 };
    let stages = attempt.solve(taken, &first)?;
    *evaluations += attempt.evaluations;
    let Some(stages) = stages else { return Ok(Err("its collocation equations did not converge".into())) };
    let q = &q[..];
    let top = stages.v.iter().fold(fastest(&*system, v), |m, v| m.max(fastest(&*system, v)));
    let (back, speed) = (velocities(taken, &stages, 0.0), fastest(&*system, v));
    let off: Vec<f64> = back.iter().zip(v).map(|(a, b)| a - b).collect();
    if fastest(&*system, &off) > LEADS_BACK * top {
        return Ok(Err("next to the position the closed mechanism does not continue with these velocities".into()));
    }
    let ahead: Vec<f64> = (0..v.len())
        .map(|i| {
            (velocities(taken, &stages, START_BESIDE)[i] - velocities(taken, &stages, -START_BESIDE)[i])
                / (2.0 * START_BESIDE * h)
        })
        .collect();
    if let Some(a) = leaving {
        let off: Vec<f64> = ahead.iter().zip(a).map(|(x, a)| x - a).collect();
        if fastest(&*system, &off) > START_BENDS * (fastest(&*system, a) + speed * speed) {
            return Ok(Err("it does not continue with the accelerations of the branch".into()));
        }
    }
    if speed < SLOW_START * top {
        return Ok(Err("its velocities are small compared with those that forces and drives produce at once".into()));
    }
    let moved = system_move(&*system, given, q);
    // the polynomials of q and u, and their values at the end
    let (mut end, mut error) = (None, 0.0f64);
    for x in [0.1, 0.37, 0.63, 0.9, 1.0] {
        let (mut q_one, u_one, work) = at(taken, h, &stages, q, &u0, x);
        let (mut q_two, u_two, _) = at(other, h, &less, q, &u0, x);
        for q in [&mut q_one, &mut q_two] {
            if !close(&mut r, t + x * h, q)? {
                return Ok(Err("the loops did not close along it".into()));
            }
        }
        let mut off_q = 0.0f64;
        for i in 0..v.len() {
            for c in system.coordinates_of(i) {
                let size =
                    if system.coordinates_of(i).len() == 1 { system.characteristic_displacement(i) } else { 1.0 };
                off_q = off_q.max((q_one[c] - q_two[c]).abs() / size);
            }
        }
        let off_u = u_one.iter().zip(&u_two).zip(&independent);
        let off_u =
            off_u.fold(0.0, |m: f64, ((a, b), &i)| m.max((a - b).abs() / system.characteristic_displacement(i)));
        let off = off_q.max(off_u / top);
        if off.is_nan() {
            return Ok(Err("it leads to NaN or infinity".into()));
        }
        error = error.max(off);
        end = Some((q_one, u_one, work));
    }
    // what the step is off by is no move of its start
    let moved = if moved > tolerance::SINGULAR_ROUNDING.max(tolerance::CLEARLY * error) { moved } else { 0.0 };
    let Some((q_end, u_end, work)) = end else { return Ok(Err("its end was not found".into())) };
    let t_end = t + h;
    r.position(t_end, &q_end)?;
    r.tangent(t_end)?;
    let distance = r.distance().0;
    r.spread(&u_end);
    let v_end = r.v.clone();
    if system_move(&*system, q, &q_end) < LEAST_START_MOVE {
        return Ok(Err(format!("it is still next to the position after {h:.1e} s")));
    }
    Ok(Ok(SingularStep {
        r,
        start: if moved > 0.0 { (t, q.to_vec(), back) } else { (t, given.to_vec(), v.to_vec()) },
        moved,
        nodes: taken.clone(),
        h,
        stages,
        distance,
        t: t_end,
        q: q_end,
        v: v_end,
        work,
        evaluations: 0,
        error,
        lenient: false,
    }))
}

/// The farthest move between two positions, in characteristic displacements.
fn system_move<S: ConstrainedSystem>(system: &S, from: &[f64], to: &[f64]) -> f64 {
    let mut far = 0.0f64;
    for i in 0..system.size().nv {
        for c in system.coordinates_of(i) {
            let size = if system.coordinates_of(i).len() == 1 { system.characteristic_displacement(i) } else { 1.0 };
            far = far.max((to[c] - from[c]).abs() / size);
        }
    }
    far
}

impl<S: ConstrainedSystem> SingularStep<'_, S> {
    /// The output at a time inside the step, closed to round-off; next to its start, where the loops cannot be closed,
    /// the polynomial itself, marked as singular.
    ///
    /// # Errors
    /// Where the system cannot be evaluated.
    pub fn output(&mut self, t: f64, out: &mut Output) -> Result<(), SystemError> {
        let (t0, q0, v0) = (self.start.0, self.start.1.clone(), self.start.2.clone());
        out.turns.clear();
        out.turns.resize(q0.len(), 0);
        out.choice = 0;
        if t <= t0 {
            out.set(t, &q0, &v0, 0.0);
            out.singular = true;
            return Ok(());
        }
        let x = (t - t0) / self.h;
        let u0: Vec<f64> = self.r.partition.independent.iter().map(|&i| v0[i]).collect();
        let (mut q, u, work) = at(&self.nodes, self.h, &self.stages, &q0, &u0, x);
        self.r.system.normalise(&mut q);
        let v = velocities(&self.nodes, &self.stages, x);
        let mut closed = q.clone();
        let regular = close(&mut self.r, t, &mut closed)
            .and_then(|there| self.r.tangent(t).map(|()| there))
            .is_ok_and(|there| there && self.r.distance().0 >= tolerance::AT_SINGULARITY * self.distance);
        match regular {
            true => {
                self.r.spread(&u);
                out.set(t, &closed, &self.r.v, work);
            }
            false => out.set(t, &q, &v, work),
        }
        out.singular = !regular;
        Ok(())
    }

    /// Length of the step (s).
    pub fn length(&self) -> f64 {
        self.h
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nodes_integrate_what_gauss_does_exactly() {
        for s in [2, 4, 8, 10] {
            let nodes = Nodes::new(s);
            for power in 0..2 * s {
                let sum: f64 = nodes.c.iter().zip(&nodes.b).map(|(c, b)| b * c.powi(power as i32)).sum();
                assert!((sum - 1.0 / (power as f64 + 1.0)).abs() < 1e-14, "{s} {power}");
            }
            for power in 0..s {
                for x in [0.1, 0.7, 1.0] {
                    let of: f64 = nodes.integrals(x).iter().zip(&nodes.c).map(|(w, c)| w * c.powi(power as i32)).sum();
                    assert!((of - x.powi(power as i32 + 1) / (power as f64 + 1.0)).abs() < 1e-13, "{s} {power} {x}");
                    let at: f64 = nodes.values(x).iter().zip(&nodes.c).map(|(w, c)| w * c.powi(power as i32)).sum();
                    assert!((at - x.powi(power as i32)).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn what_does_not_contract_is_extrapolated() {
        // x = A x + b with |A| > 1: plain iteration leaves it
        let (a, b) = ([[-1.7, 0.4], [0.3, -2.1]], [1.0, -0.5]);
        let step = |x: &[f64]| -> Vec<f64> { (0..2).map(|i| a[i][0] * x[0] + a[i][1] * x[1] + b[i] - x[i]).collect() };
        let (mut x, mut anderson) = (vec![0.0, 0.0], Anderson::default());
        for _ in 0..6 {
            let f = step(&x);
            x = anderson.next(&x, &f);
        }
        assert!(step(&x).iter().all(|f| f.abs() < 1e-12));
    }
}
