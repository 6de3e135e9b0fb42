//! The first step out of a singular position, along the branch that the velocities there single out.
//!
//! The motion along a branch is smooth, but in the position itself nothing can be evaluated: C has lost a rank. A step of
//! [`collocation`](crate::collocation) has no node at its start. Its states are q, the independent velocities u of a choice
//! that is good a little along the branch, and the work; at every node the loops are closed next to the prediction, which
//! stays on the branch, and the equations are the ordinary ones there. The step is taken with two numbers of nodes and
//! shortened until both agree.

use crate::collocation::{solve, Guess, Stages, Task, COMPARED, LESS, MORE, RULES};
use crate::counters::Counters;
use crate::ode::{Ode, RhsError};
use partita_math::tolerance;
use partita_system::manifold::kept_rows::close_kept;
use partita_system::record::Output;
use partita_system::reduction::Reduction;
use partita_system::start::choose_partition;
use partita_system::{ConstrainedSystem, SystemError, SystemRef};

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
/// No tolerance of a singular start is tighter. Unit: relative tolerance. Reason: rounding in evaluations near the
/// position.
const TIGHTEST_START: f64 = 1e-11;
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
    h: f64,
    stages: Stages,
    /// Velocities at its nodes.
    velocities: Vec<Vec<f64>>,
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

fn fastest<S: ConstrainedSystem>(system: &S, v: &[f64]) -> f64 {
    v.iter().enumerate().fold(0.0, |m: f64, (i, v)| m.max(v.abs() / system.structure().displacement(i)))
}

/// The loops closed next to q, the coordinates of independent velocities kept. False where they do not close.
fn close<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &mut [f64]) -> Result<bool, SystemError> {
    r.system.normalise(q);
    Ok(close_kept(r, t, q)?.is_closed())
}

/// The equations on a branch: rates of q, u and work where the loops are closed next to q.
struct OnBranch<'a, 's, S: ConstrainedSystem> {
    r: &'a mut Reduction<'s, S>,
    /// Velocities at the points evaluated, and what closing added at the last one.
    v: Vec<Vec<f64>>,
    shift: Vec<f64>,
}

impl<'a, 's, S: ConstrainedSystem> OnBranch<'a, 's, S> {
    fn new(r: &'a mut Reduction<'s, S>) -> Self {
        Self { r, v: Vec::new(), shift: Vec::new() }
    }

    fn rates(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), SystemError> {
        let (nq, work) = (self.r.system.size().nq, y.len() - 1);
        let mut q = y[..nq].to_vec();
        if !close(self.r, t, &mut q)? {
            return Err(SystemError::SingularStart { t, message: DID_NOT_CLOSE.into() });
        }
        self.shift.clear();
        self.shift.extend(q.iter().zip(y).map(|(q, p)| q - p));
        self.r.evaluate(t, &q, &y[nq..work])?;
        self.v.push(self.r.at.v.clone());
        self.r.rates(t, &q, dy)
    }
}

impl<S: ConstrainedSystem> Ode for OnBranch<'_, '_, S> {
    type Error = SystemError;
    fn dim(&self) -> usize {
        self.r.system.size().nq + self.r.planned.partition.independent.len() + 1
    }
    fn rhs(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), RhsError<SystemError>> {
        self.rates(t, y, dy).map_err(|e| match e {
            SystemError::SingularStart { .. } => RhsError::Retry(e),
            e if e.is_local() => RhsError::Retry(e),
            e => RhsError::Fatal(e),
        })
    }
}

const DID_NOT_CLOSE: &str = "the loops did not close along it";

/// What each of q, u and the work may be off by over a step of length h: q by its move at this speed, u by its size.
fn tolerances<S: ConstrainedSystem>(r: &Reduction<S>, speed: f64, h: f64, tolerance: f64) -> Vec<f64> {
    let system = &*r.system;
    let mut of = vec![h * speed * tolerance; system.size().nq];
    for i in 0..system.size().nv {
        if let [c] = system.structure().coordinates_of(i).collect::<Vec<_>>()[..] {
            of[c] *= system.structure().displacement(i);
        }
    }
    let of_u = |&i: &usize| speed * tolerance * system.structure().displacement(i);
    of.extend(r.planned.partition.independent.iter().map(of_u));
    of.push(f64::INFINITY);
    of
}

/// Velocities of the polynomial through those at the nodes.
fn velocities(stages: &Stages, at_nodes: &[Vec<f64>], x: f64) -> Vec<f64> {
    let mut v = vec![0.0; at_nodes[0].len()];
    for (weight, of) in stages.values(x).into_iter().zip(at_nodes) {
        v.iter_mut().zip(of).for_each(|(v, o)| *v += weight * o);
    }
    v
}

/// The first step from the singular (t, q) with the velocities v, that lie on one branch, and the accelerations with
/// which it leaves as far as they are known; C has `rank` next to it. It ends at `limit` at the latest and is exact to
/// the relative `tolerance`.
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
    let tolerance = tolerance.clamp(TIGHTEST_START, LOOSEST_START);
    let speed = fastest(&*system, v);
    // v h + a h^2 / 2 = START_MOVE
    let strong = leaving.map_or(0.0, |a| fastest(&*system, a));
    let mut h = (2.0 * START_MOVE / (speed + (speed * speed + 2.0 * START_MOVE * strong).sqrt())).min(limit - t);
    let mut evaluations = 0;
    let mut why = String::from(DID_NOT_CLOSE);
    let (mut best, mut worse): (Option<SingularStep<S>>, usize) = (None, 0);
    for _ in 0..HALVINGS {
        let whole = h == limit - t;
        match attempt(system.clone(), rank, (t, q, v), leaving, h, tolerance, &mut evaluations) {
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
            Ok(Err(reason)) => why = reason,
            Err(e) if e.is_local() => why = e.to_string(),
            Err(e) => return Err(e),
        }
        let done = best.as_ref().is_some_and(|best| best.error <= tolerance);
        h *= 0.5;
        if done || worse > 1 || tolerance::CLEARLY * h * speed < LEAST_START_MOVE {
            break;
        }
    }
    if let Some(best) = &best {
        why = format!("next to the position rounding leaves {:.1e} of the motion undetermined", best.error);
    }
    match best.filter(|best| best.error <= tolerance::ERROR_GROWTH * tolerance) {
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
            return Ok(Err(DID_NOT_CLOSE.into()));
        }
    }
    choose_partition(&mut r, t_probe, &probe, None, None)?;
    let independent = r.planned.partition.independent.clone();
    let u0: Vec<f64> = independent.iter().map(|&i| v[i]).collect();
    r.evaluate(t_probe, &probe, &u0)?;
    let mut first = vec![0.0; v.len()];
    match leaving {
        Some(a) => first.copy_from_slice(a),
        None => r.full_acceleration(&mut first),
    }
    // the prediction uses the initial velocities and the accelerations next to the start
    let (nq, width) = (q.len(), q.len() + u0.len() + 1);
    let (mut slope, mut change) = (vec![0.0; width], vec![0.0; width]);
    system.rate(q, v, &mut slope[..nq]);
    system.rate(q, &first, &mut change[..nq]);
    slope[nq..width - 1].iter_mut().zip(&independent).for_each(|(to, &i)| *to = first[i]);
    let tolerances = tolerances(&r, fastest(&*system, v) + h * fastest(&*system, &first), h, tolerance);
    let allowed: Vec<f64> = tolerances.iter().map(|x| tolerance::ERROR_GROWTH * x).collect();
    let mut y0: Vec<f64> = q.iter().chain(&u0).copied().chain([0.0]).collect();
    let mut counters = Counters::default();
    let mut stages_of = |r: &mut Reduction<'s, S>, y: &[f64], rule: usize, guess: Guess| {
        let mut branch = OnBranch::new(r);
        let task = Task { t, y, h, tolerances: &tolerances, allowed: &allowed };
        let nodes = &RULES[rule];
        let found = solve(&mut branch, &task, nodes, guess, &mut counters);
        *evaluations += std::mem::take(&mut counters.evaluations);
        let v = branch.v.split_off(branch.v.len().saturating_sub(nodes.count()));
        match found {
            Ok(stages) => Ok(stages.map(|stages| (stages, v, branch.shift))),
            Err((_, RhsError::Retry(_))) => Ok(None),
            Err((_, RhsError::Fatal(e))) => Err(e),
        }
    };
    // a start beside the position is on no branch, or on another: what closing adds along the step is taken off at its
    // start
    let (given, mut less) = (q, None);
    for _ in 0..SHIFTS {
        less = stages_of(&mut r, &y0, LESS, Guess::Line(&slope, &change))?;
        let Some((_, _, shift)) = &less else { break };
        let mut shifted: Vec<f64> = y0[..nq].iter().zip(shift).map(|(q, s)| q + s).collect();
        if system_move(&*system, &y0[..nq], &shifted) <= tolerance::CLOSED {
            break;
        }
        system.normalise(&mut shifted);
        y0[..nq].copy_from_slice(&shifted);
    }
    let Some((less, ..)) = less else { return Ok(Err("its collocation equations did not converge".into())) };
    let Some((stages, at_nodes, _)) = stages_of(&mut r, &y0, MORE, Guess::Like(&less))? else {
        return Ok(Err("its collocation equations did not converge".into()));
    };
    let q = &y0[..nq];
    let top = at_nodes.iter().fold(fastest(&*system, v), |m, v| m.max(fastest(&*system, v)));
    let (back, speed) = (velocities(&stages, &at_nodes, 0.0), fastest(&*system, v));
    let off: Vec<f64> = back.iter().zip(v).map(|(a, b)| a - b).collect();
    if fastest(&*system, &off) > tolerance::OPEN_RATE * top {
        return Ok(Err("next to the position the closed mechanism does not continue with these velocities".into()));
    }
    let ahead: Vec<f64> = (0..v.len())
        .map(|i| {
            (velocities(&stages, &at_nodes, START_BESIDE)[i] - velocities(&stages, &at_nodes, -START_BESIDE)[i])
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
    for x in COMPARED {
        let [one, two] = [&stages, &less].map(|stages| {
            let mut y = y0.clone();
            stages.advance(x, &mut y);
            y
        });
        let (mut q_one, mut q_two) = (one[..nq].to_vec(), two[..nq].to_vec());
        let (u_one, u_two, work) = (&one[nq..width - 1], &two[nq..width - 1], one[width - 1]);
        for q in [&mut q_one, &mut q_two] {
            if !close(&mut r, t + x * h, q)? {
                return Ok(Err(DID_NOT_CLOSE.into()));
            }
        }
        let mut off_q = 0.0f64;
        for i in 0..v.len() {
            for c in system.structure().coordinates_of(i) {
                let size = if system.structure().velocities[i].coordinates.len() == 1 {
                    system.structure().displacement(i)
                } else {
                    1.0
                };
                off_q = off_q.max((q_one[c] - q_two[c]).abs() / size);
            }
        }
        let off_u = u_one.iter().zip(u_two).zip(&independent);
        let off_u = off_u.fold(0.0, |m: f64, ((a, b), &i)| m.max((a - b).abs() / system.structure().displacement(i)));
        let off = off_q.max(off_u / top);
        if off.is_nan() {
            return Ok(Err("it leads to NaN or infinity".into()));
        }
        error = error.max(off);
        end = Some((q_one, u_one.to_vec(), work));
    }
    // what the step is off by is no move of its start
    let moved = if moved > tolerance::SINGULAR_ROUNDING.max(tolerance::CLEARLY * error) { moved } else { 0.0 };
    let Some((q_end, u_end, work)) = end else { return Ok(Err("its end was not found".into())) };
    let t_end = t + h;
    r.position(t_end, &q_end)?;
    r.tangent(t_end)?;
    let distance = r.distance().0;
    r.spread(&u_end);
    let v_end = r.at.v.clone();
    if system_move(&*system, q, &q_end) < LEAST_START_MOVE {
        return Ok(Err(format!("it is still next to the position after {h:.1e} s")));
    }
    Ok(Ok(SingularStep {
        r,
        start: if moved > 0.0 { (t, q.to_vec(), back) } else { (t, given.to_vec(), v.to_vec()) },
        moved,
        h,
        stages,
        velocities: at_nodes,
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
        for c in system.structure().coordinates_of(i) {
            let size = if system.structure().velocities[i].coordinates.len() == 1 {
                system.structure().displacement(i)
            } else {
                1.0
            };
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
        let u0: Vec<f64> = self.r.planned.partition.independent.iter().map(|&i| v0[i]).collect();
        let mut y: Vec<f64> = q0.iter().chain(&u0).copied().chain([0.0]).collect();
        self.stages.advance(x, &mut y);
        let (mut q, u, work) = (y[..q0.len()].to_vec(), &y[q0.len()..y.len() - 1], y[y.len() - 1]);
        self.r.system.normalise(&mut q);
        let v = velocities(&self.stages, &self.velocities, x);
        let mut closed = q.clone();
        let regular = close(&mut self.r, t, &mut closed)
            .and_then(|there| self.r.tangent(t).map(|()| there))
            .is_ok_and(|there| there && self.r.distance().0 >= tolerance::AT_SINGULARITY * self.distance);
        match regular {
            true => {
                self.r.spread(u);
                out.set(t, &closed, &self.r.at.v, work);
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
