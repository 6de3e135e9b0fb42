//! Derivatives across an instant at which velocities jump, or other rows act.
//!
//! ```text
//! dτ = −(g_x dx⁻ + g_p dp) / (g_t + g_x f⁻)
//! x⁻ + f⁻ dτ  ──  v⁺ = v⁻ + M⁻¹ Cᵀ Λ,  C v⁺ + a = 0, or −e (C v⁻ + a)  ──  x⁺ − f⁺ dτ
//! ```
//!
//! All of it at the side before. Which rows act, and that a stop bounces, is as the run found it.

use super::legs::{Instant, Stride};
use super::retaken::{constant, Rates, State};
use crate::error::AnalysisError;
use crate::run::segments::Law;
use partita_math::dense::{cholesky_backward, cholesky_forward, cholesky_solve, cholesky_straight, pivoted_cholesky};
use partita_math::scalar::Scalar;
use partita_math::tolerance;
use partita_model::carried::{Carried, CarriedState, Observable, CARRIED};
use partita_model::event_functions::Formula;
use partita_model::{Evaluator, Model};
use partita_system::prelude::*;
use partita_system::SystemError;
use std::sync::Arc;

/// What passes zero by no more than this before it turns back touches it. Scale: what a characteristic displacement of the
/// mechanism changes. Reason: a change of a number in its ninth digit would make it miss.
const TOUCHES: f64 = 1e-9;
/// Way along the motion over which the rate of an event is differenced. Scale: length of the last step. Reason: the middle of
/// the digits; the difference tells only whether an event is passed or touched.
const BEFORE: f64 = 1e-6;
/// Derivatives of times that agree within this are the same. Scale: the largest of them. Reason: what happens at once for
/// a reason happens so to rounding, which events lose six digits of.
const TOGETHER: f64 = 1e-5;

/// Why it happens.
#[derive(Clone, Debug)]
pub enum Reason {
    /// This number is zero.
    Zero(Formula),
    /// The force along this row of the mechanism before is zero, or what friction can carry.
    Force(usize),
}

/// What happens at an instant.
#[derive(Clone)]
pub struct Jump {
    /// The mechanism with all rows that may act.
    pub whole: Arc<Model>,
    /// Why, each with the name of the event.
    pub causes: Vec<(String, Reason)>,
    /// Its rows along which velocities jump.
    pub laws: Vec<(usize, Law)>,
}

/// Derivatives of a time.
pub type Shift = [f64; CARRIED];

/// A side of an instant: its mechanism, the equations with derivatives and without, and the last or the first step there.
pub struct Side<'a> {
    /// The mechanism.
    pub model: &'a Model,
    /// Its rates with derivatives.
    pub rates: &'a Rates<'a>,
    /// A step with the coordinates in use.
    pub stride: &'a Stride,
}

impl Side<'_> {
    /// q', v' and λ at a state.
    fn forces(&self, t: Carried, q: &[Carried], v: &[Carried]) -> Result<[Vec<Carried>; 2], SystemError> {
        let mut x = self.rates.of(&self.stride.choice);
        let u: Vec<Carried> = self.stride.choice.choice().independent.iter().map(|&i| v[i]).collect();
        let vdot = x.accelerations(t, q, &u)?.to_vec();
        let mut lambda = vec![constant(0.0); self.model.size().rows];
        x.multipliers(t, q, &mut lambda)?;
        Ok([vdot, lambda])
    }

    /// q' and v', in numbers.
    pub fn motion(&self, at: &Instant) -> Result<[Vec<f64>; 2], SystemError> {
        let still = State::constant(at);
        let [vdot, _] = self.forces(constant(at.t), &still.q, &still.v)?;
        let mut qdot = vec![constant(0.0); still.q.len()];
        self.rates.equations().rate(&still.q, &still.v, &mut qdot);
        let plain = |x: &[Carried]| x.iter().map(|x| x.re).collect();
        Ok([plain(&qdot), plain(&vdot)])
    }

    /// A number at a state of the mechanism.
    fn value(
        &self,
        (whole, e): (&Model, &Evaluator<Carried>),
        (name, reason): (&str, &Reason),
        t: Carried,
        (q, v): (&[Carried], &[Carried]),
    ) -> Result<Carried, AnalysisError> {
        match reason {
            Reason::Force(row) => Ok(self.forces(t, q, v)?[1][*row]),
            Reason::Zero(formula) => {
                let observers = whole.observers(e, &[Observable::Formula(formula.clone())], name)?;
                let mut out = [constant(0.0)];
                observers.read(e, &mut e.scratch(), &CarriedState { t, q, v, forces: None }, &mut out)?;
                Ok(out[0])
            }
        }
    }
}

/// The derivatives of when it happens; `carrying` makes equations with derivatives by parameters, or with none.
///
/// # Errors
/// Where it touches, or several things happen together that need not.
pub fn shift(
    jump: &Jump,
    before: &Side,
    (plain, whole): (&Side, [&Evaluator<Carried>; 2]),
    state: &State,
    at: &Instant,
) -> Result<Shift, AnalysisError> {
    let mut known: Option<(&str, Shift)> = None;
    let [qdot, vdot] = plain.motion(at)?;
    let span = BEFORE * (plain.stride.t_end - plain.stride.from.t);
    let along = |x: &[f64], rates: &[f64]| x.iter().zip(rates).map(|(x, rate)| x - span * rate).collect::<Vec<_>>();
    let earlier = Instant { t: at.t - span, q: along(&at.q, &qdot), v: along(&at.v, &vdot) };
    for (name, reason) in &jump.causes {
        let t = constant(at.t);
        let x = before.value((&jump.whole, whole[0]), (name, reason), t, (&state.q, &state.v))?;
        let (rate, size) = rate_of(plain, (&jump.whole, whole[1]), (name, reason), at)?;
        let (rate_before, _) = rate_of(plain, (&jump.whole, whole[1]), (name, reason), &earlier)?;
        let curvature = ((rate - rate_before) / span).abs();
        let beyond = 0.5 * rate * rate / curvature; // before it turns back
        if rate == 0.0 || beyond <= TOUCHES * size {
            return Err(refused(format!(
                "event \"{name}\" at t = {:.6} s only touches zero (its rate is {:.1e}), so that nothing of the run after it \
                 has a derivative; end the run before it, or change the start a little",
                at.t, rate
            )));
        }
        let found: Shift = std::array::from_fn(|l| -x.eps[l] / rate);
        match known {
            None => known = Some((name, found)),
            Some((first, other)) => {
                let largest = found.iter().chain(&other).fold(0.0, |m: f64, x| m.max(x.abs()));
                if found.iter().zip(&other).any(|(x, y)| (x - y).abs() > TOGETHER * largest) {
                    return Err(refused(format!(
                        "events \"{first}\" and \"{name}\" happen together at t = {:.6} s, and which of them is first \
                         changes with these numbers, so that nothing of the run after it has a derivative",
                        at.t
                    )));
                }
            }
        }
    }
    Ok(known.map_or([0.0; CARRIED], |x| x.1))
}

/// The rate of the reason of an event along the motion, and how much a characteristic displacement changes it.
fn rate_of(
    side: &Side,
    (whole, e): (&Model, &Evaluator<Carried>),
    reason: (&str, &Reason),
    at: &Instant,
) -> Result<(f64, f64), AnalysisError> {
    let [qdot, vdot] = side.motion(at)?;
    let still = State::constant(at);
    let structure = side.model.structure();
    let (nq, nv) = (still.q.len(), still.v.len());
    // what a coordinate is the integral of
    let mut sizes = vec![1.0; nq];
    for i in 0..nv {
        let own = structure.coordinates_of(i);
        if own.len() == 1 {
            sizes[own.start] = structure.displacement(i);
        }
    }
    let fastest = (0..nv).map(|i| at.v[i].abs() / structure.displacement(i)).fold(0.0, f64::max);
    sizes.extend((0..nv).map(|i| structure.displacement(i) * fastest));
    let motion: Vec<f64> = qdot.iter().chain(&vdot).copied().chain([1.0]).collect();
    let (mut rate, mut size) = (0.0, 0.0);
    for first in (0..motion.len()).step_by(CARRIED) {
        let (mut seeded, mut time) = (still.clone(), constant(at.t));
        let last = motion.len().min(first + CARRIED);
        for j in first..last {
            let seed = match j {
                j if j < nq => &mut seeded.q[j],
                j if j < nq + nv => &mut seeded.v[j - nq],
                _ => &mut time,
            };
            seed.eps[j - first] = 1.0;
        }
        let x = side.value((whole, e), reason, time, (&seeded.q, &seeded.v))?;
        for j in first..last {
            rate += x.eps[j - first] * motion[j];
            size += x.eps[j - first].abs() * sizes.get(j).copied().unwrap_or(0.0);
        }
    }
    Ok((rate, size))
}

fn refused(message: String) -> AnalysisError {
    AnalysisError::Argument { argument: "by", message }
}

/// A state moved along its motion by so much time.
pub fn moved(state: &mut State, [qdot, vdot]: &[Vec<f64>; 2], shift: &Shift, sign: f64) {
    let add = |x: &mut [Carried], rates: &[f64]| {
        for (x, rate) in x.iter_mut().zip(rates) {
            (0..CARRIED).for_each(|l| x.eps[l] += sign * rate * shift[l]);
        }
    };
    add(&mut state.q, qdot);
    add(&mut state.v, vdot);
}

/// Velocities after the instant, whose values are `after`; positions stay.
///
/// # Errors
/// Where bodies without mass move.
pub fn thrown(
    jump: &Jump,
    e: &Evaluator<Carried>,
    state: &State,
    t: Carried,
    after: &[f64],
) -> Result<Vec<Carried>, AnalysisError> {
    if jump.laws.is_empty() {
        return Ok(state.v.clone());
    }
    let n = state.v.len();
    let [mass, rows, a] = jump.whole.mass_and_rows(e, t, &state.q, &state.v)?;
    let mut l = mass;
    cholesky_straight(&mut l, n);
    if l.iter().step_by(n + 1).any(|x| !x.re.is_finite()) {
        return Err(refused(format!(
            "velocities jump at t = {:.6} s in a mechanism in which bodies without inertia move, of which derivatives are \
             not known; give them a small mass",
            t.re
        )));
    }
    // rows in the mass metric
    let row = |i: usize| {
        let mut x = rows[i * n..(i + 1) * n].to_vec();
        cholesky_forward(&l, n, &mut x);
        x
    };
    let dot = |x: &[Carried], y: &[Carried]| partita_math::dense::dot(x, y);
    let rate = |i: usize, v: &[Carried]| dot(&rows[i * n..(i + 1) * n], v) + a[i];
    // v ← v + M⁻¹ Cᵀ Λ such that these rows have these rates
    let brought = |laws: &[(usize, Carried)], v: &[Carried]| -> Vec<Carried> {
        let all: Vec<Vec<Carried>> = laws.iter().map(|x| row(x.0)).collect();
        let m = all.len();
        let mut gram: Vec<f64> = (0..m * m).map(|i| dot(&all[i / m], &all[i % m]).re).collect();
        let lengths: Vec<f64> = (0..m).map(|i| gram[i * m + i].sqrt().max(f64::MIN_POSITIVE)).collect();
        (0..m * m).for_each(|i| gram[i] /= lengths[i / m] * lengths[i % m]);
        let mut order: Vec<usize> = (0..m).collect();
        let rank = pivoted_cholesky(&mut gram, m, m, tolerance::REDUNDANT, &mut order);
        let kept = &order[..rank];
        let mut system: Vec<Carried> =
            (0..rank * rank).map(|i| dot(&all[kept[i / rank]], &all[kept[i % rank]])).collect();
        let mut impulses: Vec<Carried> = kept.iter().map(|&i| laws[i].1 - rate(laws[i].0, v)).collect();
        cholesky_straight(&mut system, rank);
        cholesky_solve(&system, rank, &mut impulses);
        let mut dv = vec![constant(0.0); n];
        for (&i, impulse) in kept.iter().zip(&impulses) {
            dv.iter_mut().zip(&all[i]).for_each(|(dv, x)| *dv += *x * *impulse);
        }
        cholesky_backward(&l, n, &mut dv);
        v.iter().zip(&dv).map(|(v, dv)| *v + *dv).collect()
    };
    let plain: Vec<Carried> = after.iter().map(|x| constant(*x)).collect();
    let value = |i: usize| constant(rate(i, &plain).re);
    let held: Vec<(usize, Carried)> = jump
        .laws
        .iter()
        .filter(|x| x.1 != Law::Bounces)
        .map(|&(i, law)| (i, if law == Law::Set { value(i) } else { constant(0.0) }))
        .collect();
    let met = brought(&held, &state.v);
    let bounced = jump.laws.iter().filter(|x| x.1 == Law::Bounces).map(|&(i, _)| {
        let closing = rate(i, &met);
        // the part with which it bounced
        (i, closing.scale(value(i).re / closing.re))
    });
    let all: Vec<(usize, Carried)> = held.iter().copied().chain(bounced).collect();
    Ok(if all.len() > held.len() { brought(&all, &met) } else { met })
}
