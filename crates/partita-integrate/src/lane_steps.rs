//! Steps of an explicit Runge–Kutta method for many members side by side, each with its own time and length.
//!
//! The arithmetic of [`ExplicitRungeKutta`](crate::explicit_rk::ExplicitRungeKutta), lane by lane: its rows, its sums, its error
//! norm, its dense output. Whoever drives the lanes evaluates the slopes, and decides on each lane.

use crate::combination::Row;
use crate::dense_output::{hermite, nested, DenseRows};
use crate::explicit_rk::method::{of_both, prepared, Method};
use crate::options::Options;
use crate::step_size::{enlarge, ErrorNorm};
use crate::tableau::Tableau;
use partita_math::scalar::Lanes;
use partita_math::wide::{widely, Kernel};
use std::borrow::Cow;

/// Lane l of a number.
#[inline(always)]
pub fn lane<const G: usize>(x: &[Lanes; G], l: usize) -> f64 {
    x[l / Lanes::COUNT].0[l % Lanes::COUNT]
}

/// Lane l of a number, to be written.
#[inline(always)]
pub fn lane_mut<const G: usize>(x: &mut [Lanes; G], l: usize) -> &mut f64 {
    &mut x[l / Lanes::COUNT].0[l % Lanes::COUNT]
}

/// The states, slopes and lengths of 8 G members.
#[derive(Debug)]
pub struct LaneSteps<const G: usize> {
    tableau: &'static Tableau,
    dim: usize,
    method: Cow<'static, Method>,
    dense: Cow<'static, DenseRows>,
    norm: ErrorNorm,
    /// State at the start of the step, and at its end.
    pub y: Vec<[Lanes; G]>,
    /// See `y`.
    pub y_new: Vec<[Lanes; G]>,
    /// Slopes, slot by slot.
    stages: Vec<[Lanes; G]>,
    /// Lengths of the steps.
    pub h: [Lanes; G],
    coefficients: Vec<[Lanes; G]>,
    /// A state and a slope of one member.
    one: [Vec<f64>; 2],
}

/// `out = base + h Σ w_j k_j`, or `h Σ w_j k_j` without a base.
struct Combination<'a, const G: usize> {
    row: &'a Row,
    stages: &'a [[Lanes; G]],
    h: &'a [Lanes; G],
    base: Option<&'a [[Lanes; G]]>,
    out: &'a mut [[Lanes; G]],
}

impl<const G: usize> Kernel for Combination<'_, G> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let dim = self.out.len();
        for (i, out) in self.out.iter_mut().enumerate() {
            for g in 0..G {
                let sum = self.row.sum(|slot| &self.stages[slot * dim + i][g].0);
                for l in 0..Lanes::COUNT {
                    let base = self.base.map_or(0.0, |base| base[i][g].0[l]);
                    out[g].0[l] = base + self.h[g].0[l] * sum[l];
                }
            }
        }
    }
}

/// For both rows, the largest `(Σ w_j k_j / tolerance)²`.
struct Errors<'a, const G: usize> {
    rows: &'a [Row; 2],
    stages: &'a [[Lanes; G]],
    y: &'a [[Lanes; G]],
    y_new: &'a [[Lanes; G]],
    norm: &'a ErrorNorm,
}

impl<const G: usize> Kernel for Errors<'_, G> {
    type Output = [[Lanes; G]; 2];
    #[inline(always)]
    fn run(self) -> Self::Output {
        let dim = self.y.len();
        let mut squares = [[Lanes::default(); G]; 2];
        for i in 0..dim {
            for g in 0..G {
                let tolerance = self.norm.tolerances_in_lanes(i, (&self.y[i][g].0, &self.y_new[i][g].0));
                for (row, squares) in self.rows.iter().zip(&mut squares) {
                    let error = row.sum(|slot| &self.stages[slot * dim + i][g].0);
                    enlarge(&mut squares[g].0, &error, &tolerance);
                }
            }
        }
        squares
    }
}

impl<const G: usize> LaneSteps<G> {
    /// Members.
    pub const LANES: usize = G * Lanes::COUNT;

    /// For equations of this dimension, all of it controlled; `sizes` are the natural ones of the components. None for a
    /// method that estimates its error otherwise than DOP853.
    pub fn new(tableau: &'static Tableau, options: &Options, sizes: &[f64]) -> Option<Self> {
        let dim = sizes.len();
        let (method, dense) = prepared(tableau);
        method.both()?;
        let mut norm = ErrorNorm::new(options, None, dim, dim);
        norm.set_sizes(sizes);
        let zeros = |n: usize| vec![[Lanes::default(); G]; n];
        Some(Self {
            dim,
            coefficients: zeros(dim * (3 + dense.rows.len())),
            method,
            dense,
            norm,
            y: zeros(dim),
            y_new: zeros(dim),
            stages: zeros(dim * tableau.slots()),
            h: [Lanes::default(); G],
            one: [vec![0.0; dim], vec![0.0; dim]],
            tableau,
        })
    }

    /// Number of the stages of a step.
    pub fn stages(&self) -> usize {
        self.tableau.stages
    }

    /// Slot of the slope at the end of a step.
    pub fn end_slot(&self) -> usize {
        self.tableau.end_slot()
    }

    /// Node of a stage.
    pub fn node(&self, stage: usize) -> f64 {
        self.tableau.c[stage]
    }

    /// Additional stages of dense output: slot and node.
    pub fn extra(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.dense.extra.iter().map(|stage| (stage.slot, stage.node))
    }

    /// Slope of a slot.
    pub fn slope(&mut self, slot: usize) -> &mut [[Lanes; G]] {
        &mut self.stages[slot * self.dim..][..self.dim]
    }

    /// State at which a stage is evaluated.
    pub fn at_stage(&mut self, stage: usize, out: &mut [[Lanes; G]]) {
        let (row, stages, h) = (&self.method.stages[stage], &self.stages, &self.h);
        widely(Combination { row, stages, h, base: Some(&self.y), out });
    }

    /// State at which an additional stage of dense output is evaluated.
    pub fn at_extra(&mut self, slot: usize, out: &mut [[Lanes; G]]) {
        let extra = &self.dense.extra[slot - self.tableau.end_slot() - 1];
        let (row, stages, h) = (&extra.row, &self.stages, &self.h);
        widely(Combination { row, stages, h, base: Some(&self.y), out });
    }

    /// The end of the steps, into `y_new`; returns their errors, with their margin, in units of the tolerance.
    pub fn finish(&mut self) -> [Lanes; G] {
        let (stages, h) = (&self.stages, &self.h);
        widely(Combination { row: &self.method.end, stages, h, base: Some(&self.y), out: &mut self.y_new });
        let rows = self.method.both().expect("a method without two estimates has no lanes");
        let (y, y_new, norm) = (&self.y[..], &self.y_new[..], &self.norm);
        let [fifth, third] = widely(Errors { rows, stages, y, y_new, norm });
        std::array::from_fn(|g| Lanes::from_fn(|l| of_both(self.h[g].0[l], fifth[g].0[l], third[g].0[l])))
    }

    /// The steps of these lanes are taken.
    pub fn accept(&mut self, lanes: impl Iterator<Item = usize>) {
        let end = self.end_slot() * self.dim;
        for l in lanes {
            for i in 0..self.dim {
                *lane_mut(&mut self.y[i], l) = lane(&self.y_new[i], l);
                *lane_mut(&mut self.stages[i], l) = lane(&self.stages[end + i], l);
            }
        }
    }

    /// Coefficients of dense output, all slopes being known.
    pub fn fill_dense(&mut self) {
        let (n, end) = (self.dim, self.end_slot() * self.dim);
        for i in 0..n {
            for g in 0..G {
                for l in 0..Lanes::COUNT {
                    let between = [&self.y[i], &self.y_new[i]].map(|y| y[g].0[l]);
                    let slopes = [i, end + i].map(|i| self.stages[i][g].0[l]);
                    for (j, f) in hermite(self.h[g].0[l], between, slopes).into_iter().enumerate() {
                        self.coefficients[j * n + i][g].0[l] = f;
                    }
                }
            }
        }
        for (row, out) in self.dense.rows.iter().zip(self.coefficients[3 * n..].chunks_exact_mut(n.max(1))) {
            widely(Combination { row, stages: &self.stages, h: &self.h, base: None, out });
        }
    }

    /// Component i of the state of lane l at this part of its step.
    pub fn dense(&self, l: usize, i: usize, theta: f64) -> f64 {
        let f = |j: usize| &self.coefficients[j * self.dim + i][l / Lanes::COUNT].0[l % Lanes::COUNT..];
        let [sum] = nested(theta, 2 + self.dense.rows.len(), f);
        lane(&self.y[i], l) + theta * sum
    }

    fn read(&mut self, l: usize) {
        for i in 0..self.dim {
            (self.one[0][i], self.one[1][i]) = (lane(&self.y[i], l), lane(&self.stages[i], l));
        }
    }

    /// First guess for the first step of lane l, from its state and slope.
    pub fn first_guess(&mut self, l: usize) -> f64 {
        self.read(l);
        self.norm.first_guess(&self.one[0], &self.one[1])
    }

    /// Better guess, from the slope at the end of an Euler step of the length `guess`.
    pub fn second_guess(&mut self, l: usize, guess: f64, slope: &[f64]) -> f64 {
        self.read(l);
        self.norm.second_guess(guess, self.tableau.error_order, &self.one[0], &self.one[1], slope)
    }
}
