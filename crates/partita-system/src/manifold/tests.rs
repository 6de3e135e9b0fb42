//! Closing from afar and near by, its order, what stays open; curves followed over full turns and to their ends.

use super::kept_rows::{KeptRows, TO_ROUND_OFF};
use super::least_change::{from_afar, LeastChange};
use super::scaled::Scaled;
use super::truncated::{Along, Cut, Truncated, TO_REST};
use super::*;
use crate::equations::{Equations, UserSystem};
use crate::error::Result;
use crate::record::Correction;
use crate::reduction::Reduction;
use crate::system::{ConstrainedSystem, SystemError};
use std::f64::consts::{PI, TAU};

/// Chains of links with their directions as coordinates, each from a pivot at the origin to one at (base, 0).
#[derive(Clone)]
pub(crate) struct Chains(Vec<(Vec<f64>, f64)>);

impl Chains {
    pub(crate) fn one(lengths: &[f64], base: f64) -> UserSystem<Self> {
        UserSystem::new(Self(vec![(lengths.to_vec(), base)]))
    }
}

impl Equations for Chains {
    fn n(&self) -> usize {
        self.0.iter().map(|x| x.0.len()).sum()
    }
    fn rows(&self) -> usize {
        2 * self.0.len()
    }
    fn holonomic(&self) -> usize {
        self.rows()
    }
    fn name(&self, i: usize) -> String {
        format!("q{i}")
    }
    fn rheonomic(&self) -> bool {
        false
    }
    fn mass(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<()> {
        let n = self.n();
        out.fill(0.0);
        (0..n).for_each(|i| out[i * n + i] = 1.0 + 0.3 * i as f64);
        Ok(())
    }
    fn forces(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        Ok(())
    }
    fn constraints(&self, _: f64, q: &[f64], out: &mut [f64]) -> Result<()> {
        let mut first = 0;
        for ((lengths, base), row) in self.0.iter().zip(out.chunks_exact_mut(2)) {
            (row[0], row[1]) = (-base, 0.0);
            for (l, q) in lengths.iter().zip(&q[first..]) {
                row[0] += l * q.cos();
                row[1] += l * q.sin();
            }
            first += lengths.len();
        }
        Ok(())
    }
    fn jacobian(&self, _: f64, q: &[f64], out: &mut [f64]) -> Result<()> {
        let (n, mut first) = (self.n(), 0);
        out.fill(0.0);
        for (c, (lengths, _)) in self.0.iter().enumerate() {
            for (i, l) in lengths.iter().enumerate().map(|(i, l)| (first + i, l)) {
                out[2 * c * n + i] = -l * q[i].sin();
                out[(2 * c + 1) * n + i] = l * q[i].cos();
            }
            first += lengths.len();
        }
        Ok(())
    }
    fn rate(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        Ok(())
    }
    fn bias(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        Ok(())
    }
}

pub(crate) const CRANK_ROCKER: ([f64; 3], f64) = ([1.0, 3.0, 2.5], 3.2);

/// Closed, crank at the angle given; the links of the chain are crank, coupler, and the rocker towards the ground.
pub(crate) fn four_bar(crank: f64) -> [f64; 3] {
    let ([a, b, c], g) = CRANK_ROCKER;
    let (x, y) = (g - a * crank.cos(), -a * crank.sin());
    let d = x.hypot(y);
    let turn = ((b * b + d * d - c * c) / (2.0 * b * d)).acos();
    let coupler = y.atan2(x) + turn;
    [crank, coupler, (y - b * coupler.sin()).atan2(x - b * coupler.cos())]
}

fn closure_error<E: Equations>(system: &UserSystem<E>, q: &[f64]) -> f64 {
    let mut phi = vec![0.0; system.equations.holonomic()];
    system.equations.constraints(0.0, q, &mut phi).unwrap();
    phi.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
}

/// By what counts above the level, scales as at q.
fn truncated<'s, S: ConstrainedSystem>(system: &'s S, q: &[f64], level: f64) -> Truncated<'s, S> {
    Truncated::new(Scaled::new(system, 0.0, q, &[]).unwrap(), 0.0, Cut::Level(level))
}

/// Every way to find a linear step, from a start off by `far`; positions as they closed.
fn every_step(system: &UserSystem<Chains>, closed: &[f64; 3], far: f64) -> Vec<(&'static str, [f64; 3], Closed)> {
    let start = [closed[0] + far, closed[1] - 0.7 * far, closed[2] + 0.4 * far];
    let mut memory = ClosingScratch::default();
    let mut found = Vec::new();
    for (name, rule) in [("partition", Correction::Partition), ("mass metric", Correction::MassOrthogonal)] {
        let mut r = Reduction::new(system, 2);
        r.first_partition(0.0, closed).unwrap();
        let mut q = start;
        let mut rows = KeptRows::new(&mut r, 0.0, rule);
        let done = close(&mut rows, &mut q, &TO_ROUND_OFF, &mut memory).unwrap();
        found.push((name, q, done));
    }
    let mut q = start;
    let mut rows = LeastChange::new(system, 0.0, &start, &[]).unwrap();
    let done = close(&mut rows, &mut q, &from_afar(1e-12), &mut memory).unwrap();
    found.push(("least change", q, done));
    let mut q = start;
    let done = truncated(system, &start, 1e-7).close(&mut q, &mut memory).unwrap();
    found.push(("truncated", q, done));
    found
}

#[test]
fn every_linear_step_closes_to_rounding_from_near_and_far() {
    let (lengths, base) = CRANK_ROCKER;
    let system = Chains::one(&lengths, base);
    for far in [1e-6, 0.01, 0.3, 0.9] {
        for crank in [0.4, 2.0, 4.0] {
            for (name, q, done) in every_step(&system, &four_bar(crank), far) {
                assert!(done.is_closed(), "{name} from {far}: {done:?}");
                // round-off of six numbers up to 3.2
                assert!(closure_error(&system, &q) < 4e-15, "{name} from {far}: {:e}", closure_error(&system, &q));
            }
        }
    }
}

#[test]
fn the_partition_keeps_independent_coordinates_and_least_changes_are_the_nearest() {
    let (lengths, base) = CRANK_ROCKER;
    let system = Chains::one(&lengths, base);
    let far = 1e-5;
    let closed = four_bar(1.0);
    let start = [closed[0] + far, closed[1] - 0.7 * far, closed[2] + 0.4 * far];
    let found = every_step(&system, &closed, far);
    let mut r = Reduction::new(&system, 2);
    r.first_partition(0.0, &closed).unwrap();
    let kept = r.planned.partition.independent[0];
    assert_eq!(found[0].1[kept].to_bits(), start[kept].to_bits());
    // moves are perpendicular to the tangent in their metric, but for the curvature over the move
    let tangent: Vec<f64> = (0..3).map(|i| r.at.dt[i]).collect();
    for (which, metric) in [(1, [1.0, 1.3, 1.6]), (2, [1.0; 3]), (3, [1.0; 3])] {
        let along: f64 = (0..3).map(|i| metric[i] * tangent[i] * (found[which].1[i] - start[i])).sum();
        assert!(along.abs() < 100.0 * far * far, "{}: {along:e}", found[which].0);
    }
}

/// A linearization that notes what was open at each evaluation.
struct RecordingLinearization<L> {
    of: L,
    closure_error: Vec<f64>,
}

impl<L: Linearization> Residuals for RecordingLinearization<L> {
    fn evaluate(&mut self, q: &[f64]) -> Result<()> {
        self.of.evaluate(q)?;
        self.closure_error.push(self.of.closure_error(0).worst);
        Ok(())
    }
    fn closure_error(&self, part: usize) -> ClosureError {
        self.of.closure_error(part)
    }
}

impl<L: Linearization> Linearization for RecordingLinearization<L> {
    fn solve(&mut self, q: &[f64], parts: &[Part]) -> Result<bool> {
        self.of.solve(q, parts)
    }
    fn length(&self, part: usize) -> f64 {
        self.of.length(part)
    }
    fn scale(&mut self, part: usize, by: f64) {
        self.of.scale(part, by);
    }
    fn advance(&mut self, q: &mut [f64]) {
        self.of.advance(q);
    }
    fn least_damping(&self, part: usize) -> Option<f64> {
        self.of.least_damping(part)
    }
    fn is_settled(&self) -> bool {
        self.of.is_settled()
    }
}

/// The slope of log(next) over log(one) for what is open, round-off left out.
fn order(closure_error: &[f64]) -> f64 {
    let seen: Vec<&[f64]> = closure_error.windows(3).filter(|w| w[0] < 0.1 && w[2] > 1e-13).collect();
    let w = seen.last().expect("three numbers above round-off");
    (w[2] / w[1]).ln() / (w[1] / w[0]).ln()
}

#[test]
fn convergence_is_of_second_order() {
    let (lengths, base) = CRANK_ROCKER;
    let system = Chains::one(&lengths, base);
    let closed = four_bar(2.0);
    let start = [closed[0] + 0.3, closed[1] - 0.2, closed[2] + 0.1];
    let mut memory = ClosingScratch::default();
    let mut r = Reduction::new(&system, 2);
    r.first_partition(0.0, &closed).unwrap();
    let mut by_partition =
        RecordingLinearization { of: KeptRows::new(&mut r, 0.0, Correction::Partition), closure_error: Vec::new() };
    close(&mut by_partition, &mut start.clone(), &TO_ROUND_OFF, &mut memory).unwrap();
    // in units of round-off
    let closure_error: Vec<f64> = by_partition.closure_error.iter().map(|x| x * 4.0 * f64::EPSILON).collect();
    assert!((order(&closure_error) - 2.0).abs() < 0.3, "partition: {:?}", closure_error);
    let mut least =
        RecordingLinearization { of: LeastChange::new(&system, 0.0, &start, &[]).unwrap(), closure_error: Vec::new() };
    close(&mut least, &mut start.clone(), &from_afar(1e-12), &mut memory).unwrap();
    assert!((order(&least.closure_error) - 2.0).abs() < 0.3, "least change: {:?}", least.closure_error);
    let mut truncated = RecordingLinearization { of: truncated(&system, &start, 1e-7), closure_error: Vec::new() };
    close(&mut truncated, &mut start.clone(), &TO_REST, &mut memory).unwrap();
    assert!((order(&truncated.closure_error) - 2.0).abs() < 0.3, "truncated: {:?}", truncated.closure_error);
}

#[test]
fn what_cannot_close_comes_to_rest_open_by_what_is_missing_and_its_neighbour_closes() {
    // two links of 1 span no more than 2 of 3; the other chain closes
    let system = UserSystem::new(Chains(vec![(vec![1.0, 1.0], 3.0), (vec![1.0, 1.5, 1.0], 2.0)]));
    let mut q = [0.5, -0.3, 0.4, 0.1, -0.9];
    let mut memory = ClosingScratch::default();
    let mut rows = LeastChange::new(&system, 0.0, &q, &[]).unwrap();
    let done = close(&mut rows, &mut q, &from_afar(1e-12), &mut memory).unwrap();
    assert_eq!(done.ending, Ending::AtRest);
    let mut phi = [0.0; 4];
    system.equations.constraints(0.0, &q, &mut phi).unwrap();
    // dense equations are one part, which rests when its slope is a thousandth
    assert!((phi[0] + 1.0).abs() < 1e-6 && phi[1].abs() < 1e-6, "{phi:?}");
    assert!(phi[2].abs() < 1e-3 && phi[3].abs() < 1e-3, "{phi:?}");
}

/// A point on two circles about the origin whose squares differ by 2e.
struct TwoCircles(f64);

impl Equations for TwoCircles {
    fn n(&self) -> usize {
        2
    }
    fn rows(&self) -> usize {
        2
    }
    fn holonomic(&self) -> usize {
        2
    }
    fn name(&self, i: usize) -> String {
        ["x", "y"][i].into()
    }
    fn rheonomic(&self) -> bool {
        false
    }
    fn mass(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&[1.0, 0.0, 0.0, 1.0]);
        Ok(())
    }
    fn forces(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        Ok(())
    }
    fn constraints(&self, _: f64, q: &[f64], out: &mut [f64]) -> Result<()> {
        let half = 0.5 * (q[0] * q[0] + q[1] * q[1] - 1.0);
        out.copy_from_slice(&[half, half - self.0]);
        Ok(())
    }
    fn jacobian(&self, _: f64, q: &[f64], out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&[q[0], q[1], q[0], q[1]]);
        Ok(())
    }
    fn rate(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        Ok(())
    }
    fn bias(&self, _: f64, _: &[f64], v: &[f64], out: &mut [f64]) -> Result<()> {
        out.fill(v[0] * v[0] + v[1] * v[1]);
        Ok(())
    }
}

#[test]
fn rows_that_contradict_each_other_rest_half_way_and_are_followed_there() {
    for e in [1e-3, 1e-5, 1e-8] {
        let system = UserSystem::new(TwoCircles(e));
        let mut q = [1.1, 0.2];
        let mut rows = truncated(&system, &q, 1e-3);
        let done = rows.close(&mut q, &mut ClosingScratch::default()).unwrap();
        assert_eq!(done.ending, Ending::AtRest);
        let half = |q: &[f64]| 0.5 * (q[0] * q[0] + q[1] * q[1] - 1.0) - 0.5 * e;
        // in natural scales: a large move from x = 1.1 opens the rows by its square
        let least = 0.5 * (e / 1.1f64.powi(2)).powi(2);
        assert!(half(&q).abs() < 1e-13 && (done.closure_error.square - least).abs() < 1e-6 * least, "{done:?}");
        let pace = Pace { longest: 0.1, shortest: 1e-6, steps: 1000 };
        let done = follow(&mut Along::new(&mut rows, e), &mut q, &[0.0, 1.0], 5.0, &pace, &mut |_, at| {
            assert!(half(at.q).abs() < 1e-13);
            Ok(Visit::On)
        });
        assert_eq!(done.unwrap().end, End::There);
    }
}

/// Equations f(x) = 0 of a number each, for the rules of the loop alone: value and slope. Each is a part.
struct Scalars<F> {
    f: Vec<F>,
    at: Vec<(f64, f64)>,
    step: Vec<f64>,
    evaluations: usize,
}

fn scalars<F: Fn(f64) -> (f64, f64)>(f: Vec<F>) -> Scalars<F> {
    Scalars { at: vec![(0.0, 0.0); f.len()], step: vec![0.0; f.len()], f, evaluations: 0 }
}

fn scalar<F: Fn(f64) -> (f64, f64)>(f: F) -> Scalars<F> {
    scalars(vec![f])
}

impl<F: Fn(f64) -> (f64, f64)> Residuals for Scalars<F> {
    fn evaluate(&mut self, q: &[f64]) -> Result<()> {
        self.evaluations += 1;
        self.at.iter_mut().zip(&self.f).zip(q).for_each(|((at, f), x)| *at = f(*x));
        match self.at.iter().all(|x| x.0.is_finite()) {
            true => Ok(()),
            false => Err(SystemError::NotFinite { what: "f".into(), t: 0.0 }),
        }
    }
    fn parts(&self) -> usize {
        self.f.len()
    }
    fn closure_error(&self, part: usize) -> ClosureError {
        ClosureError::of([self.at[part].0].into_iter())
    }
    fn keep(&self, part: usize, from: &[f64], to: &mut [f64]) {
        to[part] = from[part];
    }
}

impl<F: Fn(f64) -> (f64, f64)> Linearization for Scalars<F> {
    fn solve(&mut self, _: &[f64], parts: &[Part]) -> Result<bool> {
        for ((step, at), p) in self.step.iter_mut().zip(&self.at).zip(parts) {
            *step = if p.is_active() { -at.0 / at.1 } else { 0.0 };
        }
        Ok(true)
    }
    fn length(&self, part: usize) -> f64 {
        self.step[part].abs()
    }
    fn scale(&mut self, part: usize, by: f64) {
        self.step[part] *= by;
    }
    fn advance(&mut self, q: &mut [f64]) {
        q.iter_mut().zip(&self.step).for_each(|(q, d)| *q += d);
    }
}

#[test]
fn each_part_takes_its_own_steps_and_ends_by_itself() {
    let alone = |f: fn(f64) -> (f64, f64), x: f64| {
        let mut q = [x];
        let done = close(&mut scalar(f), &mut q, &Rule::new(60, 1e-15, 1e-12), &mut ClosingScratch::default()).unwrap();
        (q[0], done)
    };
    let f: [fn(f64) -> (f64, f64); 4] = [
        |x| (x.atan(), 1.0 / (1.0 + x * x)),
        |x| (x * x + 0.1, 2.0 * x),
        |x| (x * x - 2.0, 2.0 * x),
        |x| (x - 0.5, 1.0),
    ];
    let start = [3.0, 1.0, 5.0, 0.5];
    let (mut q, mut memory) = (start, ClosingScratch::default());
    let done = close(&mut scalars(f.to_vec()), &mut q, &Rule::new(60, 1e-15, 1e-12), &mut memory).unwrap();
    let mut most = 0;
    for i in 0..4 {
        let (x, one) = alone(f[i], start[i]);
        assert!(memory.parts[i].ending == Some(one.ending) && q[i] == x, "{i}");
        most = most.max(one.iterations);
    }
    assert_eq!((done.ending, done.iterations), (Ending::Unfinished, most));
    assert!(memory.parts[3].moved == 0.0 && q[3] == 0.5);
}

#[test]
fn steps_that_gain_nothing_are_shortened_and_those_that_do_not_contract_end() {
    let mut memory = ClosingScratch::default();
    // Newton's method alone runs away from here
    let atan = |x: f64| (x.atan(), 1.0 / (1.0 + x * x));
    let mut q = [3.0];
    let done = close(&mut scalar(atan), &mut q, &Rule::new(60, 1e-15, 1e-12), &mut memory).unwrap();
    assert!(done.is_closed() && q[0].abs() < 1e-12, "{done:?} {q:?}");
    let near = Rule::new(60, 1e-15, 1e-12).contracting(0.5, 0.25);
    let done = close(&mut scalar(atan), &mut [3.0], &near, &mut memory).unwrap();
    assert_eq!(done.ending, Ending::Elsewhere);
    let done = close(&mut scalar(atan), &mut [0.3], &near, &mut memory).unwrap();
    assert!(done.is_closed());
    // beyond 0 nothing can be evaluated, and the first step leads there
    let mut q = [0.9];
    let done = close(&mut scalar(|x| (x.ln() + 2.0, 1.0 / x)), &mut q, &Rule::new(60, 1e-15, 1e-12), &mut memory);
    assert!(done.unwrap().is_closed() && (q[0] - (-2.0f64).exp()).abs() < 1e-15);
    // cut steps take as many as the way is long
    let cut = Rule::new(60, 1e-15, 1e-12).cut(0.5);
    let done = close(&mut scalar(|x| (x - 10.0, 1.0)), &mut [0.0], &cut, &mut memory).unwrap();
    assert!(done.is_closed() && done.iterations == 20 && (done.moved - 10.0).abs() < 1e-12, "{done:?}");
    // a double root is closed by halves; what has none is not
    let done = close(&mut scalar(|x| (x * x, 2.0 * x)), &mut [1.0], &Rule::new(60, 1e-15, 1e-12), &mut memory);
    assert!(done.unwrap().is_closed());
    let done = close(&mut scalar(|x| (x * x + 0.1, 2.0 * x)), &mut [1.0], &Rule::new(60, 1e-15, 1e-12), &mut memory);
    let done = done.unwrap();
    assert!(done.ending == Ending::Unfinished && done.closure_error.worst < 0.11, "{done:?}");
}

#[test]
fn closed_positions_cost_one_evaluation_and_keep_their_digits() {
    let mut f = scalar(|x| (x, 1.0));
    let mut q = [1e-16];
    let done = close(&mut f, &mut q, &Rule::new(60, 1e-15, 1e-12), &mut ClosingScratch::default()).unwrap();
    assert!(done.is_closed() && done.iterations == 0 && f.evaluations == 1 && q == [1e-16]);
    // what rounding leaves open is closed when no step gains, at the best position found
    let mut f = scalar(|x| (x + 3e-14, 1.0 + 1e-3));
    let done = close(&mut f, &mut [1e-3], &Rule::new(60, 0.0, 1e-12), &mut ClosingScratch::default()).unwrap();
    assert!(done.is_closed() && done.closure_error.worst <= 1e-13, "{done:?}");
}

#[test]
fn a_four_bar_is_followed_over_full_turns_on_its_branch() {
    let (lengths, base) = CRANK_ROCKER;
    let system = Chains::one(&lengths, base);
    let start = four_bar(0.3);
    for sign in [1.0, -1.0] {
        let mut rows = truncated(&system, &start, 1e-7);
        let mut curve = Along::new(&mut rows, 1e-12);
        let mut q = start;
        // three turns: the crank is the fastest link most of the time
        let (mut positions, mut least) = (0, f64::INFINITY);
        let pace = Pace { longest: follow::LONGEST_PREDICTION, shortest: 1e-6, steps: 10_000 };
        let done = follow(&mut curve, &mut q, &[sign, 0.0, 0.0], 60.0, &pace, &mut |curve, at| {
            positions += 1;
            assert!(closure_error(&system, at.q) < 1e-12);
            // the elbow keeps its side
            assert!((at.q[2] - at.q[1]).sin() * (start[2] - start[1]).sin() > 0.0);
            least = least.min(curve.free.as_ref().unwrap().pivots[1]);
            let through = (at.q[0] - start[0]) * sign;
            Ok(if through > 3.0 * TAU { Visit::Stop } else { Visit::On })
        })
        .unwrap();
        assert_eq!(done.end, End::Stopped);
        assert!(done.steps == positions && least > 0.05);
    }
}

#[test]
fn halving_steps_lead_to_the_same_positions() {
    let (lengths, base) = CRANK_ROCKER;
    let system = Chains::one(&lengths, base);
    let mut ends = Vec::new();
    for longest in [0.3, 0.1, 0.01] {
        let mut q = four_bar(0.3);
        let mut rows = truncated(&system, &q, 1e-7);
        let pace = Pace { longest, shortest: 1e-6, steps: 10_000 };
        let done =
            follow(&mut Along::new(&mut rows, 1e-12), &mut q, &[1.0, 0.0, 0.0], 1.5, &pace, &mut |_, _| Ok(Visit::On));
        assert_eq!(done.unwrap().end, End::There);
        ends.push(q);
        // wherever along the curve it came to: on it
        let exact = four_bar(q[0]);
        assert!((q[1] - exact[1]).abs() < 1e-12 && (q[2] - exact[2]).abs() < 1e-12);
    }
    assert!((ends[0][0] - ends[2][0]).abs() < 0.02 && (ends[1][0] - ends[2][0]).abs() < 0.005, "{ends:?}");
}

#[test]
fn curves_end_with_their_reason() {
    let pace = Pace { longest: follow::LONGEST_PREDICTION, shortest: 1e-7, steps: 10_000 };
    let on = |_: &mut Along<UserSystem<Chains>>, _: At| Ok(Visit::On);
    // three links in one line, as long as the base: free for an instant only
    let line = Chains::one(&[1.0, 1.5, 0.5], 3.0);
    let mut q = [0.0; 3];
    let mut rows = truncated(&line, &q, 1e-7);
    let mut curve = Along::new(&mut rows, 1e-12);
    let done = follow(&mut curve, &mut q, &[1.0, -1.0, 1.0], 1.0, &pace, &mut { on }).unwrap();
    assert_eq!(done.end, End::ThrownBack);
    assert!(done.s < 1e-2 && q.iter().all(|x| x.abs() < 1e-2), "{done:?} {q:?}");
    // nothing to go along: two links and a base that is a triangle
    let triangle = Chains::one(&[1.0, 1.0], 1.0);
    let mut q = [PI / 3.0, -PI / 3.0];
    let mut rows = truncated(&triangle, &q, 1e-7);
    let mut curve = Along::new(&mut rows, 1e-12);
    let done = follow(&mut curve, &mut q, &[1.0, 1.0], 1.0, &pace, &mut { on }).unwrap();
    assert!(done.end == End::Limit && done.steps == 0);
    // a visitor that stops, one that refuses, and more steps than allowed
    let (lengths, base) = CRANK_ROCKER;
    let system = Chains::one(&lengths, base);
    let mut rows = truncated(&system, &four_bar(0.3), 1e-7);
    let (mut q, mut curve) = (four_bar(0.3), Along::new(&mut rows, 1e-12));
    let direction = [1.0, 0.0, 0.0];
    let done = follow(&mut curve, &mut q, &direction, 9.0, &pace, &mut |_, _| Ok(Visit::Stop)).unwrap();
    assert!(done.end == End::Stopped && done.steps == 1 && done.s > 0.2);
    q = four_bar(0.3);
    let wall = |_: &mut Along<UserSystem<Chains>>, at: At| Ok(if at.q[0] > 1.0 { Visit::Back } else { Visit::On });
    let done = follow(&mut curve, &mut q, &direction, 9.0, &pace, &mut { wall }).unwrap();
    assert!(done.end == End::Refused && (0.999_999..=1.0).contains(&q[0]), "{done:?} {q:?}");
    q = four_bar(0.3);
    let few = Pace { steps: 3, ..pace };
    let done = follow(&mut curve, &mut q, &direction, 9.0, &few, &mut { on }).unwrap();
    assert!(done.end == End::Long && done.steps == 3);
    // no length, no step
    let done = follow(&mut curve, &mut q, &direction, 0.0, &pace, &mut { on }).unwrap();
    assert!(done.end == End::There && done.steps == 0);
}
