//! Derivatives carried along the steps of a run: each is taken again, by the same coefficients and for the same coordinates,
//! with numbers that have derivatives along some directions.
//!
//! ```text
//! explicit   y_i = y + h Σ a_ij f(y_j)                     over these numbers
//! implicit   (1 − h a ⊗ J) δk = f_y δy + f_p δp            what is solved is differentiated, not the solver
//! end        q_D ← q_D − C_D⁻¹ Φ,   v = Dᵀ v_I + η         over these numbers                  (34, P2)
//! ```
//!
//! Between two steps the derivatives of all coordinates and of all velocities are known, so that nothing is done where
//! coordinates are exchanged.

use super::legs::{Instant, Leg, Stride};
use super::programs::Programs;
use crate::error::AnalysisError;
use partita_integrate::scheme::Scheme;
use partita_math::dense::{lu, lu_solve};
use partita_math::scalar::{Dual, Scalar};
use partita_model::carried::{Carried, CARRIED};
use partita_model::Evaluator;
use partita_model::Model;
use partita_system::choice::{Choice, OwnedChoice};
use partita_system::rates::ChosenRates;
use partita_system::SystemError;
use std::sync::Arc;

/// Iterations of Newton's method for the stages of an implicit step that is taken again. Unit: number. Reason: they begin at
/// the stages of the run, which were solved for, or a step's length away.
const MOST_ITERATIONS: usize = 30;
/// Stages are solved for where they change by less. Scale: fraction of their largest rate. Reason: a few digits above
/// rounding; derivatives are as exact.
const STAGES_SOLVED: f64 = 1e-13;

/// Coordinates and velocities with derivatives.
#[derive(Clone, Debug, Default)]
pub struct State {
    /// Coordinates.
    pub q: Vec<Carried>,
    /// Velocities.
    pub v: Vec<Carried>,
}

/// A number without derivatives.
pub fn constant(x: f64) -> Carried {
    Dual::constant(x)
}

/// The same derivatives, of these values.
pub fn put_values(x: &mut [Carried], values: &[f64]) {
    x.iter_mut().zip(values).for_each(|(x, value)| x.re = *value);
}

impl State {
    /// Without derivatives.
    pub fn constant(at: &Instant) -> Self {
        let lift = |x: &[f64]| x.iter().map(|x| constant(*x)).collect();
        Self { q: lift(&at.q), v: lift(&at.v) }
    }

    /// The same derivatives at this state.
    pub fn put_at(&mut self, at: &Instant) {
        put_values(&mut self.q, &at.q);
        put_values(&mut self.v, &at.v);
    }
}

/// What gathers an integral: gets a weight, a time, coordinates, and the rates evaluated there.
pub type Gather<'g> =
    &'g mut dyn FnMut(f64, f64, &[Carried], &mut dyn ChosenRates<Carried>) -> Result<(), AnalysisError>;

/// The stages of an implicit step.
pub struct Solved {
    /// Their slopes.
    pub slopes: Vec<Vec<f64>>,
    /// Their states.
    pub states: Vec<Vec<f64>>,
    /// `1 − h a ⊗ J`, row by row.
    pub matrix: Vec<f64>,
}

/// `y + h Σ w_j k_j` in numbers.
pub fn advanced_plain(y: &[f64], h: f64, weights: &[f64], slopes: &[Vec<f64>]) -> Vec<f64> {
    let mut out = y.to_vec();
    for (weight, slope) in weights.iter().zip(slopes).filter(|x| *x.0 != 0.0) {
        out.iter_mut().zip(slope).for_each(|(y, k)| *y += h * weight * k);
    }
    out
}

/// What takes outputs: its number, the instant, the state there, and the coordinates in use.
pub type Taken<'t> = &'t mut dyn FnMut(usize, &Instant, &State, &Arc<OwnedChoice>) -> Result<(), AnalysisError>;

/// The rates of the steps of a leg for one choice after the other.
pub struct Rates<'e> {
    model: &'e Model,
    e: &'e Evaluator<Carried>,
    /// Values that the rows keep: what a lock holds is where it began.
    pub kept: Vec<Carried>,
    nq: usize,
    /// Programs of the rates, and the first of the directions.
    programs: Option<(&'e Programs, usize)>,
}

/// `y + h Σ w_j k_j`.
fn advanced(y: &[Carried], h: f64, weights: &[f64], slopes: &[Vec<Carried>]) -> Vec<Carried> {
    let mut out = y.to_vec();
    for (weight, slope) in weights.iter().zip(slopes).filter(|x| *x.0 != 0.0) {
        out.iter_mut().zip(slope).for_each(|(y, k)| *y += k.scale(h * weight));
    }
    out
}

impl<'e> Rates<'e> {
    /// Of a mechanism with derivatives.
    pub fn new(model: &'e Model, e: &'e Evaluator<Carried>, (nq, holonomic): (usize, usize)) -> Self {
        Self { model, e, kept: vec![constant(0.0); holonomic], nq, programs: None }
    }

    /// With programs of the rates, along the directions from the `first` on.
    pub fn with(mut self, programs: &'e Programs, first: usize) -> Self {
        self.programs = Some((programs, first));
        self
    }

    /// The mechanism with derivatives.
    pub fn equations(&self) -> &'e Evaluator<Carried> {
        self.e
    }

    /// What rows hold from a position on is where it is.
    pub fn keep(&mut self, choice: &OwnedChoice, t: f64, q: &[Carried]) -> Result<(), SystemError> {
        let phi = self.of(choice).phi(constant(t), q)?.to_vec();
        self.kept = phi.iter().map(|x| Carried::new(0.0, x.eps)).collect();
        Ok(())
    }

    /// For a choice.
    pub fn of<'c>(&self, choice: &'c OwnedChoice) -> Box<dyn ChosenRates<Carried> + 'c>
    where
        'e: 'c,
    {
        self.model.carried_rates(self.e, choice.choice())
    }

    /// q' and v_I' at (t, y).
    fn slope(&self, x: &mut dyn ChosenRates<Carried>, t: f64, y: &[Carried]) -> Result<Vec<Carried>, SystemError> {
        let mut out = vec![constant(0.0); y.len()];
        let (q, u) = y.split_at(self.nq);
        x.rates(constant(t), q, u, &mut out)?;
        Ok(out)
    }

    /// `(q, v_I)`.
    fn independent(choice: Choice, state: &State) -> Vec<Carried> {
        state.q.iter().copied().chain(choice.independent.iter().map(|&i| state.v[i])).collect()
    }

    /// The state at the end of a step from `state` on, or at an earlier time, whose values are known; `gather` gets the weight
    /// of each stage in an integral over the step, and the stage.
    pub fn arrived(
        &self,
        stride: &Stride,
        state: &State,
        to: &Instant,
        mut gather: Option<Gather>,
    ) -> Result<State, AnalysisError> {
        let mut x = self.of(&stride.choice);
        let (t, h) = (stride.from.t, to.t - stride.from.t);
        let y = Self::independent(stride.choice.choice(), state);
        let scheme = &stride.taken.scheme;
        let end = match (scheme.implicit, stride.across) {
            (false, _) => {
                let mut slopes = Vec::with_capacity(scheme.c.len());
                let program = self.programs.filter(|_| gather.is_none());
                let mut program = program.and_then(|(programs, first)| programs.of(stride, self.nq, first));
                for (c, row) in scheme.c.iter().zip(&scheme.a) {
                    let stage = advanced(&y, h, row, &slopes);
                    slopes.push(match &mut program {
                        Some(program) => program.slope(t + c * h, &stage),
                        None => self.slope(&mut *x, t + c * h, &stage)?,
                    });
                    if let Some(gather) = &mut gather {
                        gather(h * scheme.b[slopes.len() - 1], t + c * h, &stage[..self.nq], &mut *x)?;
                    }
                }
                advanced(&y, h, &scheme.b, &slopes)
            }
            (true, false) => {
                let guess = (to.t == stride.t_end).then_some((&stride.taken.states[..], stride.dim));
                let slopes = self.implicit(&mut *x, scheme, (t, h), &y, guess)?;
                self.gathered(&mut *x, scheme, (t, h), (&y, &slopes), &mut gather)?;
                advanced(&y, h, &scheme.b, &slopes)
            }
            // its polynomial: other nodes may lie next to the singular position
            (true, true) => {
                let whole = stride.t_end - t;
                let guess = Some((&stride.taken.states[..], stride.dim));
                let slopes = self.implicit(&mut *x, scheme, (t, whole), &y, guess)?;
                self.gathered(&mut *x, scheme, (t, whole), (&y, &slopes), &mut gather)?;
                advanced(&y, whole, &weights_until(scheme, h / whole), &slopes)
            }
        };
        self.closed(&mut *x, end, to)
    }

    /// The stages of an implicit step, gathered.
    fn gathered(
        &self,
        x: &mut dyn ChosenRates<Carried>,
        scheme: &Scheme,
        (t, h): (f64, f64),
        (y, slopes): (&[Carried], &[Vec<Carried>]),
        gather: &mut Option<Gather>,
    ) -> Result<(), AnalysisError> {
        let Some(gather) = gather else { return Ok(()) };
        for ((c, row), b) in scheme.c.iter().zip(&scheme.a).zip(&scheme.b) {
            let stage = advanced(y, h, row, slopes);
            self.slope(x, t + c * h, &stage)?;
            gather(h * b, t + c * h, &stage[..self.nq], x)?;
        }
        Ok(())
    }

    /// A state that is closed, of (q, v_I) with derivatives, its values known.                       (34, P2)
    pub fn closed(
        &self,
        x: &mut dyn ChosenRates<Carried>,
        y: Vec<Carried>,
        to: &Instant,
    ) -> Result<State, AnalysisError> {
        let (mut q, u) = (y[..self.nq].to_vec(), &y[self.nq..]);
        put_values(&mut q, &to.q);
        self.e.normalise(&mut q);
        x.correct_to(constant(to.t), &mut q, &self.kept)?;
        put_values(&mut q, &to.q);
        let v = x.velocities(constant(to.t), &q, u)?.to_vec();
        let mut state = State { q, v };
        put_values(&mut state.v, &to.v);
        Ok(state)
    }

    /// The stages of an implicit step at (t, y) in numbers, from the states of its stages on, or from its start.
    pub fn stages(
        &self,
        choice: &OwnedChoice,
        scheme: &Scheme,
        at: (f64, f64),
        y: &[f64],
        guess: Option<(&[f64], usize)>,
    ) -> Result<Solved, AnalysisError> {
        self.solved(&mut *self.of(choice), scheme, at, y, guess)
    }

    fn solved(
        &self,
        x: &mut dyn ChosenRates<Carried>,
        scheme: &Scheme,
        (t, h): (f64, f64),
        y: &[f64],
        guess: Option<(&[f64], usize)>,
    ) -> Result<Solved, AnalysisError> {
        let (dim, stages) = (y.len(), scheme.c.len());
        let lifted = |x: &[f64]| x.iter().map(|x| constant(*x)).collect::<Vec<_>>();
        let mut slopes: Vec<Vec<f64>> = Vec::with_capacity(stages);
        for (i, c) in scheme.c.iter().enumerate() {
            let known = guess.and_then(|(states, dim)| states.chunks_exact(dim.max(1)).nth(i));
            let from = known.filter(|known| known.len() >= dim).map_or(y, |known| &known[..dim]);
            slopes.push(self.slope(x, t + c * h, &lifted(from))?.iter().map(|x| x.re).collect());
        }
        let size = stages * dim;
        let singular = || SystemError::NotFinite { what: "the stages of an implicit step".into(), t };
        let mut pivots = vec![0; size];
        for last in (0..MOST_ITERATIONS).rev() {
            let (mut matrix, mut off) = (vec![0.0; size * size], vec![0.0; size]);
            let mut states = Vec::with_capacity(stages);
            for (i, row) in scheme.a.iter().enumerate() {
                let state = advanced_plain(y, h, row, &slopes);
                let (slope, jacobian) = self.jacobian(x, t + scheme.c[i] * h, &lifted(&state))?;
                states.push(state);
                for l in 0..dim {
                    off[i * dim + l] = slope[l] - slopes[i][l];
                    for (j, a) in row.iter().enumerate() {
                        for m in 0..dim {
                            matrix[(i * dim + l) * size + j * dim + m] = -h * a * jacobian[l * dim + m];
                        }
                    }
                    matrix[(i * dim + l) * size + i * dim + l] += 1.0;
                }
            }
            let mut factored = matrix.clone();
            lu(&mut factored, size, &mut pivots).map_err(|_| singular())?;
            lu_solve(&factored, size, &pivots, &mut off);
            let moved = off.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            let all = slopes.iter().flatten().fold(0.0, |m: f64, x| m.max(x.abs()));
            slopes.iter_mut().flatten().zip(&off).for_each(|(k, off)| *k += off);
            if moved <= STAGES_SOLVED * all || last == 0 {
                return Ok(Solved { slopes, states, matrix });
            }
        }
        Err(singular().into())
    }

    /// Slopes of the stages of an implicit step, with derivatives.
    fn implicit(
        &self,
        x: &mut dyn ChosenRates<Carried>,
        scheme: &Scheme,
        (t, h): (f64, f64),
        y: &[Carried],
        guess: Option<(&[f64], usize)>,
    ) -> Result<Vec<Vec<Carried>>, AnalysisError> {
        let dim = y.len();
        let plain: Vec<f64> = y.iter().map(|y| y.re).collect();
        let Solved { slopes, mut matrix, .. } = self.solved(x, scheme, (t, h), &plain, guess)?;
        let mut slopes: Vec<Vec<Carried>> = slopes.iter().map(|x| x.iter().map(|x| constant(*x)).collect()).collect();
        let size = scheme.c.len() * dim;
        let mut pivots = vec![0; size];
        lu(&mut matrix, size, &mut pivots)
            .map_err(|_| SystemError::NotFinite { what: "the stages of an implicit step".into(), t })?;
        // the right sides, and what they make of the stages
        let mut along = vec![[0.0; CARRIED]; size];
        for (i, row) in scheme.a.iter().enumerate() {
            let state = advanced(y, h, row, &slopes);
            let found = self.slope(x, t + scheme.c[i] * h, &state)?;
            along[i * dim..(i + 1) * dim].iter_mut().zip(&found).for_each(|(to, x)| *to = x.eps);
        }
        let mut column = vec![0.0; size];
        for l in 0..CARRIED {
            column.iter_mut().zip(&along).for_each(|(to, x)| *to = x[l]);
            lu_solve(&matrix, size, &pivots, &mut column);
            slopes.iter_mut().flatten().zip(&column).for_each(|(k, x)| k.eps[l] = *x);
        }
        Ok(slopes)
    }

    /// See `weights_until`.
    pub fn weights_until(scheme: &Scheme, x: f64) -> Vec<f64> {
        weights_until(scheme, x)
    }

    /// The slope at (t, y), and its derivatives by y, row by row, where parameters stay.
    fn jacobian(
        &self,
        x: &mut dyn ChosenRates<Carried>,
        t: f64,
        y: &[Carried],
    ) -> Result<(Vec<f64>, Vec<f64>), SystemError> {
        let dim = y.len();
        let mut jacobian = vec![0.0; dim * dim];
        let still = self.slope(x, t, &y.iter().map(|y| constant(y.re)).collect::<Vec<_>>())?;
        for first in (0..dim).step_by(CARRIED) {
            let mut seeded: Vec<Carried> = y.iter().map(|y| constant(y.re)).collect();
            (first..dim.min(first + CARRIED)).for_each(|j| seeded[j].eps[j - first] = 1.0);
            let found = self.slope(x, t, &seeded)?;
            for j in first..dim.min(first + CARRIED) {
                // what the parameters change stands in all
                (0..dim).for_each(|i| jacobian[i * dim + j] = found[i].eps[j - first] - still[i].eps[j - first]);
            }
        }
        Ok((still.iter().map(|x| x.re).collect(), jacobian))
    }
}

/// Integrals from 0 to x of the Lagrange polynomials of the nodes of a collocation.
fn weights_until(scheme: &Scheme, x: f64) -> Vec<f64> {
    let c = &scheme.c;
    let lagrange =
        |j: usize, at: f64| -> f64 { (0..c.len()).filter(|&i| i != j).map(|i| (at - c[i]) / (c[j] - c[i])).product() };
    let integral = |j: usize| x * c.iter().zip(&scheme.b).map(|(c, b)| b * lagrange(j, x * c)).sum::<f64>();
    (0..c.len()).map(integral).collect()
}

/// The steps of a leg, with derivatives from `state` on; `take` gets each output. Returns the state at its end.
pub fn along(
    leg: &Leg,
    rates: &Rates,
    mut state: State,
    mut gather: Option<Gather>,
    take: Taken,
) -> Result<State, AnalysisError> {
    if let Some(stride) = leg.strides.first() {
        for (number, at) in &leg.first {
            take(*number, at, &state, &stride.choice)?;
        }
    }
    for (i, stride) in leg.strides.iter().enumerate() {
        let next = leg.strides.get(i + 1).map_or(&leg.end, |next| &next.from);
        state.put_at(&stride.from);
        let to = Instant { t: stride.t_end, ..next.clone() };
        let end = match &mut gather {
            Some(gather) => rates.arrived(stride, &state, &to, Some(&mut **gather))?,
            None => rates.arrived(stride, &state, &to, None)?,
        };
        for (number, at) in &stride.outputs {
            match at.t == stride.t_end {
                true => take(*number, at, &end, &stride.choice)?,
                false => take(*number, at, &rates.arrived(stride, &state, at, None)?, &stride.choice)?,
            }
        }
        state = end;
    }
    Ok(state)
}
