//! Explicit closing of several loops: block by block, with inputs that the system changes when they run into dead points.

use crate::pieces::{any, distance, march, reference, times, Angles, Pendulum, GRAVITY, GROUND, LENGTHS};
use partita_integrate::simulate::{simulate, Status};
use partita_system::closing::{Block, BlockState, Closing};
use partita_system::equations::{Equations, UserScratch, UserSystem};
use partita_system::formulation::motion::ExplicitClosing;
use partita_system::formulation::motion::Projective;
use partita_system::formulation::Formulation;
use partita_system::kinematics::{assembly, velocity};
use partita_system::options::FormulationOptions;
use partita_system::record::Sample;
use partita_system::system::{Guards, Levels, Manifold, Methods, Metric, Structure, Tangent};
use partita_system::{start, SystemError, SystemRef};
use std::ops::ControlFlow;

type Done = Result<(), SystemError>;

/// Uniform rods in the plane, in their angles: loops `Σ β_j u_j = gap`, centres of mass at `Σ α_j u_j` from fixed points.
struct Rods {
    /// Mass, central inertia, own angle and α of each rod.
    rods: Vec<(f64, f64, usize, Vec<f64>)>,
    /// β and gap of each loop.
    loops: Vec<(Vec<f64>, [f64; 2])>,
}

/// The reference four-bar whose rocker reaches beyond its ground pin D and drives a second loop from there.
///
/// ```text
///      B --1-- C
///     0|       |2
///      A       D         u2 points from C over D to F
///              |2  3
///              F ---- H
///                     |4
///                     G
/// ```
fn six_bar() -> Rods {
    let [l0, l1, l2] = LENGTHS;
    let (lever, l3, l4) = (0.8, 1.8, 1.5);
    let rod = |l: f64, own: usize, arms: [f64; 5]| (l, l.powi(3) / 12.0, own, arms.to_vec());
    Rods {
        rods: vec![
            rod(l0, 0, [0.5 * l0, 0.0, 0.0, 0.0, 0.0]),
            rod(l1, 1, [l0, 0.5 * l1, 0.0, 0.0, 0.0]),
            rod(l2 + lever, 2, [0.0, 0.0, 0.5 * (lever - l2), 0.0, 0.0]),
            rod(l3, 3, [0.0, 0.0, lever, 0.5 * l3, 0.0]),
            rod(l4, 4, [0.0, 0.0, 0.0, 0.0, -0.5 * l4]),
        ],
        loops: vec![(vec![l0, l1, l2, 0.0, 0.0], [GROUND, 0.0]), (vec![0.0, 0.0, lever, l3, l4], [2.0, 0.0])],
    }
}

/// Four rods between two ground pins: two degrees of freedom.
fn five_bar() -> Rods {
    let l = [1.0, 1.6, 1.6, 1.0];
    let arms = |i: usize| (0..4).map(|j| if j < i { l[j] } else { f64::from(u8::from(j == i)) * 0.5 * l[i] }).collect();
    Rods {
        rods: (0..4).map(|i| (l[i], l[i].powi(3) / 12.0, i, arms(i))).collect(),
        loops: vec![(l.to_vec(), [1.8, 0.0])],
    }
}

impl Rods {
    /// a_jk of `M_jk = a_jk cos(φ_j − φ_k)`.
    fn a(&self, j: usize, k: usize) -> f64 {
        let turn = |own: usize, inertia: f64| if own == j && own == k { inertia } else { 0.0 };
        self.rods.iter().map(|(m, inertia, own, arms)| m * arms[j] * arms[k] + turn(*own, *inertia)).sum()
    }

    fn energy(&self, s: &Sample) -> f64 {
        let (n, q, v) = (self.n(), &s.q, &s.v);
        let pair = |e: usize| self.a(e / n, e % n) * (q[e / n] - q[e % n]).cos() * v[e / n] * v[e % n];
        let height = |j: usize| self.rods.iter().map(|r| r.0 * r.3[j]).sum::<f64>() * q[j].sin();
        0.5 * (0..n * n).map(pair).sum::<f64>() + GRAVITY * (0..n).map(height).sum::<f64>()
    }
}

impl Equations for Rods {
    fn n(&self) -> usize {
        self.rods.len()
    }
    fn rows(&self) -> usize {
        2 * self.loops.len()
    }
    fn holonomic(&self) -> usize {
        self.rows()
    }
    fn name(&self, i: usize) -> String {
        format!("rod {i}")
    }
    fn rheonomic(&self) -> bool {
        false
    }
    fn mass(&self, _: f64, q: &[f64], out: &mut [f64]) -> Done {
        let n = self.n();
        (0..n * n).for_each(|e| out[e] = self.a(e / n, e % n) * (q[e / n] - q[e % n]).cos());
        Ok(())
    }
    fn forces(&self, _: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Done {
        for (j, h) in out.iter_mut().enumerate() {
            let weight: f64 = self.rods.iter().map(|r| r.0 * r.3[j]).sum();
            let turning: f64 = (0..v.len()).map(|k| self.a(j, k) * (q[j] - q[k]).sin() * v[k] * v[k]).sum();
            *h = -turning - GRAVITY * weight * q[j].cos();
        }
        Ok(())
    }
    fn constraints(&self, _: f64, q: &[f64], out: &mut [f64]) -> Done {
        for (i, (l, gap)) in self.loops.iter().enumerate() {
            out[2 * i] = l.iter().zip(q).map(|(l, q)| l * q.cos()).sum::<f64>() - gap[0];
            out[2 * i + 1] = l.iter().zip(q).map(|(l, q)| l * q.sin()).sum::<f64>() - gap[1];
        }
        Ok(())
    }
    fn jacobian(&self, _: f64, q: &[f64], out: &mut [f64]) -> Done {
        let n = self.n();
        for (i, (l, _)) in self.loops.iter().enumerate() {
            for j in 0..n {
                out[2 * i * n + j] = -l[j] * q[j].sin();
                out[(2 * i + 1) * n + j] = l[j] * q[j].cos();
            }
        }
        Ok(())
    }
    fn rate(&self, _: f64, _: &[f64], out: &mut [f64]) -> Done {
        out.fill(0.0);
        Ok(())
    }
    fn bias(&self, _: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Done {
        for (i, (l, _)) in self.loops.iter().enumerate() {
            out[2 * i] = -(0..v.len()).map(|j| l[j] * q[j].cos() * v[j] * v[j]).sum::<f64>();
            out[2 * i + 1] = -(0..v.len()).map(|j| l[j] * q[j].sin() * v[j] * v[j]).sum::<f64>();
        }
        Ok(())
    }
}

/// Rods whose loops are closed one after another: the inputs that may be chosen, and the two unknowns of each loop.
struct Recognised {
    user_system: UserSystem<Rods>,
    choices: Vec<(Vec<usize>, Vec<[usize; 2]>)>,
}

impl Recognised {
    fn six_bar() -> Self {
        let choices =
            vec![(vec![0], vec![[1, 2], [3, 4]]), (vec![1], vec![[0, 2], [3, 4]]), (vec![2], vec![[0, 1], [3, 4]])];
        Self { user_system: UserSystem::new(six_bar()), choices }
    }

    fn five_bar() -> Self {
        let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
        let others = |p: [usize; 2]| (0..4).filter(|i| !p.contains(i)).collect::<Vec<_>>();
        let choices = pairs.map(|p| (p.to_vec(), vec![[others(p)[0], others(p)[1]]]));
        Self { user_system: UserSystem::new(five_bar()), choices: choices.to_vec() }
    }

    /// Sines between the unknown rods of each loop: their pivots.
    fn pivots(unknown: &[[usize; 2]], q: &[f64]) -> Vec<f64> {
        unknown.iter().map(|[i, j]| (q[*j] - q[*i]).sin()).collect()
    }
}

/// Two intersecting circles per loop, one loop after another.
struct Dyads<'a> {
    system: SystemRef<'a, Recognised>,
    inputs: Vec<usize>,
    unknown: Vec<[usize; 2]>,
    blocks: Vec<Block>,
    state: Vec<BlockState>,
}

impl Closing for Dyads<'_> {
    fn inputs(&self) -> &[usize] {
        &self.inputs
    }
    fn blocks(&self) -> &[Block] {
        &self.blocks
    }
    fn close(&mut self, t: f64, q: &mut [f64]) -> Done {
        for (b, &[i, j]) in self.unknown.iter().enumerate() {
            let (l, gap) = &self.system.user_system.equations.loops[b];
            let rest =
                |f: fn(f64) -> f64| (0..q.len()).filter(|k| *k != i && *k != j).map(|k| l[k] * f(q[k])).sum::<f64>();
            let (x, y) = (gap[0] - rest(f64::cos), gap[1] - rest(f64::sin));
            // the triangle of l_i, l_j and the diagonal
            let r = x.hypot(y);
            let cos = (l[i] * l[i] + r * r - l[j] * l[j]) / (2.0 * l[i] * r);
            if cos.abs() > 1.0 {
                let shortfall = r * (cos.abs() - 1.0);
                return Err(SystemError::Limit { block: self.blocks[b].words.clone(), t, shortfall });
            }
            let first = y.atan2(x) - f64::from(self.state[b].branch) * cos.acos();
            let second = (y - l[i] * first.sin()).atan2(x - l[i] * first.cos());
            q[i] = crate::pieces::nearest_turn(first, q[i]);
            q[j] = crate::pieces::nearest_turn(second, q[j]);
            self.state[b].pivot = (q[j] - q[i]).sin().abs();
        }
        Ok(())
    }
    fn state(&self) -> &[BlockState] {
        &self.state
    }
    fn set_branches(&mut self, branches: &[i8]) {
        self.state.iter_mut().zip(branches).filter(|x| *x.1 != 0).for_each(|(s, b)| s.branch = *b);
    }
}

impl Levels for Recognised {
    type Scratch = UserScratch;
    fn structure(&self) -> &Structure {
        self.user_system.structure()
    }
    fn scratch(&self) -> UserScratch {
        self.user_system.scratch()
    }
    fn position(&self, t: f64, q: &[f64], s: &mut UserScratch, phi: &mut [f64], c: &mut [f64], a: &mut [f64]) -> Done {
        self.user_system.position(t, q, s, phi, c, a)
    }
    fn velocity(&self, t: f64, q: &[f64], v: &[f64], s: &mut UserScratch, b: &mut [f64]) -> Done {
        self.user_system.velocity(t, q, v, s, b)
    }
    fn dynamics(&self, t: f64, q: &[f64], v: &[f64], s: &mut UserScratch, mass: &mut [f64], h: &mut [f64]) -> Done {
        self.user_system.dynamics(t, q, v, s, mass, h)
    }
    fn project(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        tangent: &Tangent,
        s: &mut UserScratch,
        md: &mut [f64],
        hd: &mut [f64],
    ) -> Done {
        self.user_system.project(t, q, v, tangent, s, md, hd)
    }
    fn inverse_dynamics(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        vdot: &[f64],
        s: &mut UserScratch,
        out: &mut [f64],
    ) -> Done {
        self.user_system.inverse_dynamics(t, q, v, vdot, s, out)
    }
}

impl Metric for Recognised {
    fn inverse_mass_diagonal(&self, t: f64, q: &[f64], s: &mut UserScratch, out: &mut [f64]) -> Done {
        self.user_system.inverse_mass_diagonal(t, q, s, out)
    }
    fn inverse_mass_columns(&self, t: f64, q: &[f64], which: &[usize], s: &mut UserScratch, out: &mut [f64]) -> Done {
        self.user_system.inverse_mass_columns(t, q, which, s, out)
    }
}

impl Manifold for Recognised {}

impl Guards for Recognised {}

impl partita_system::system::Varied for Recognised {}

impl Methods for Recognised {
    /// The inputs asked for, or those with the largest product of pivots.
    fn closing<'s>(
        system: SystemRef<'s, Self>,
        _: f64,
        q: &[f64],
        inputs: Option<&[usize]>,
    ) -> Result<Box<dyn Closing + Send + 's>, SystemError>
    where
        Self: 's,
    {
        let product = |u: &[[usize; 2]]| Self::pivots(u, q).iter().product::<f64>().abs();
        let found = match inputs {
            Some(asked) => system.choices.iter().find(|c| c.0 == asked),
            None => system.choices.iter().max_by(|x, y| product(&x.1).total_cmp(&product(&y.1))),
        };
        let Some((inputs, unknown)) = found else {
            return Err(SystemError::argument("independent", "no such inputs".into()));
        };
        let branch = |p: f64| BlockState { branch: if p > 0.0 { 1 } else { -1 }, pivot: p.abs() };
        let block = |(b, u): (usize, &[usize; 2])| Block {
            rows: vec![2 * b, 2 * b + 1],
            unknown: u.to_vec(),
            explicit: true,
            words: format!("dyad of rods {} and {}", u[0], u[1]),
        };
        Ok(Box::new(Dyads {
            inputs: inputs.clone(),
            unknown: unknown.clone(),
            blocks: unknown.iter().enumerate().map(block).collect(),
            state: Self::pivots(unknown, q).into_iter().map(branch).collect(),
            system: system.clone(),
        }))
    }
}

/// A closed position next to `guess` and velocities with the given rates.
fn at_rates(system: &Recognised, guess: &[f64], rates: &[(usize, f64)]) -> (Vec<f64>, Vec<f64>) {
    let mut q = guess.to_vec();
    assembly::close(system, 0.0, &mut q, 1e-12, &[]).unwrap();
    let mut r = partita_system::reduction::Reduction::new(system, system.size().rows);
    start::choose_partition(&mut r, 0.0, &q, None, None).unwrap();
    let v = velocity::with_rates(&mut r, 0.0, &q, rates).unwrap();
    (q, v)
}

fn explicit(system: &Recognised, inputs: Option<Vec<usize>>, switch_threshold: f64) -> ExplicitClosing<'_, Recognised> {
    let options = FormulationOptions { independent: inputs, switch_threshold, ..FormulationOptions::default() };
    ExplicitClosing::new(system, system.size().rows, &options).unwrap()
}

fn against_the_compact_form(
    system: &Recognised,
    (q, v): &(Vec<f64>, Vec<f64>),
    switch_threshold: f64,
    least_changes: u64,
) {
    let at = times(0.25, 10);
    let settings = reference(at[9]);
    let mut projective = Projective::new(system, system.size().rows, &FormulationOptions::default());
    let exact = march(&mut projective, q, v, &at, &settings);
    let mut f = explicit(system, None, switch_threshold);
    let samples = march(&mut f, q, v, &at, &settings);
    // tolerance 2e-14, about a thousand steps, growth of errors by some hundreds
    assert!(distance(&samples, &exact) < 1e-8, "{:e}", distance(&samples, &exact));
    let (first, energy) = (&samples[0], |s: &Sample| system.user_system.equations.energy(s));
    for (x, y) in samples.iter().zip(&exact) {
        assert!(x.closure < 1e-13 && x.velocity_closure < 1e-12 * 50.0, "{:e} {:e}", x.closure, x.velocity_closure);
        x.multipliers.iter().zip(&y.multipliers).for_each(|(x, y)| assert!((x - y).abs() < 1e-5 * (1.0 + y.abs())));
        // the measure belongs to the mechanism
        x.measure.iter().zip(&y.measure).for_each(|(x, y)| assert!((x - y).abs() < 1e-7));
        assert!((energy(x) - energy(first)).abs() < 1e-8 * energy(first).abs().max(1.0));
    }
    let changes = f.history().counters.switches;
    assert!(changes >= least_changes, "{changes}");
    assert_eq!(f.history().events.len() as u64, 1 + changes);
    for e in &f.history().events[1..] {
        assert!(!e.entering.is_empty() && e.reason.contains("as inputs: the volume"), "{}", e.reason);
    }
    assert_eq!(f.history().rows, (0..system.size().rows).collect::<Vec<_>>());
    assert!(f.history().notes.len() == 1 && f.history().notes[0].contains("dyad of rods"), "{:?}", f.history().notes);
}

#[test]
fn two_loops_in_a_row() {
    let system = Recognised::six_bar();
    let [a, b] = Angles::close(0.8);
    let start = at_rates(&system, &[0.8, a, b, 0.4, -0.6], &[(0, 1.5)]);
    against_the_compact_form(&system, &start, 1.05, 2);
}

#[test]
fn two_inputs() {
    let system = Recognised::five_bar();
    let start = at_rates(&system, &[1.9, 0.7, -0.7, -1.9], &[(0, 3.0), (3, 1.0)]);
    against_the_compact_form(&system, &start, 1.25, 2);
}

/// Inputs of the user stay: at their dead point the run ends, and says which loop it was.
#[test]
fn a_dead_point_of_fixed_inputs_ends_the_run() {
    let system = Recognised::six_bar();
    let [a, b] = Angles::close(0.8);
    let (q, v) = at_rates(&system, &[0.8, a, b, 0.4, -0.6], &[(0, 6.0)]);
    let mut f = explicit(&system, Some(vec![2]), 1.25);
    let mut settings = reference(10.0);
    settings.options.rtol = 1e-8;
    settings.options.atol = 1e-8.into();
    let outcome =
        simulate(&mut f, 0.0, &q, &v, &[], &settings, &mut |_| Ok(()), &mut |_| ControlFlow::Continue(())).unwrap();
    assert_ne!(outcome.status, Status::Finished, "{}", outcome.message);
    assert!(outcome.message.contains("dyad of rods 0 and 1"), "{}", outcome.message);
    assert!(f.history().counters.switches == 0 && f.history().events.len() == 1);
    // the crank itself goes round
    let mut f = explicit(&system, Some(vec![0]), 1.25);
    march(&mut f, &q, &v, &[5.0], &reference(5.0));
}

/// Blocks that do not fit the constraints are refused before the first step.
#[test]
fn blocks_are_checked() {
    let refused = |unknown: Vec<[usize; 2]>, word: &str| {
        let mut system = Recognised::six_bar();
        system.choices = vec![(vec![0], unknown)];
        let [a, b] = Angles::close(0.8);
        let (q, v) = at_rates(&Recognised::six_bar(), &[0.8, a, b, 0.4, -0.6], &[(0, 1.5)]);
        let mut f = explicit(&system, None, 1.25);
        let mut y = vec![0.0; f.layout().dim()];
        match f.start(0.0, &q, &v, &mut y) {
            Err(SystemError::Argument { message, .. }) => assert!(message.contains(word), "{message}"),
            other => panic!("{other:?}"),
        }
    };
    refused(vec![[1, 2], [3, 0]], "solves for rod 0, which is known already");
    refused(vec![[1, 2]], "no block solves for rod 3");
}

/// A hand-written closing that cannot close says so, and the step is shortened until nothing is left of it.
#[test]
fn a_pendulum_in_x_stops_at_the_side() {
    let system = any(Pendulum::RESTING_PIVOT);
    let mut f = ExplicitClosing::new(&system, 1, &FormulationOptions::default()).unwrap();
    let (q, v) = (vec![0.6, -0.8], vec![0.8 * 7.0, 0.6 * 7.0]);
    let outcome =
        simulate(&mut f, 0.0, &q, &v, &[], &reference(2.0), &mut |_| Ok(()), &mut |_| ControlFlow::Continue(()))
            .unwrap();
    // x = 1 is reached after about 0.13 s
    assert!(outcome.t > 0.1 && outcome.t < 0.2, "{}", outcome.t);
    assert_eq!(outcome.status, Status::Singular);
    for words in ["coordinates x are at a dead point", "closing function for y would have to", "y would serve"] {
        assert!(outcome.message.contains(words), "{}", outcome.message);
    }
}
