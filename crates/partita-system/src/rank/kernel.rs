//! Phi and C of the closings at one position as dense matrices in natural sizes, and what their singular values say.

use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense::Matrix;
use partita_math::factor::{pivoted_least_norm, qr_null_space_by, svd, svd_full};

/// Iterations of a closing: three or four of Newton's method for each grade of the level.
const ITERATIONS: usize = 60;
/// First grade of the level: graded, the closing does not jump off along weak rows.                    (11.9, 1)
const COARSE: f64 = 0.03;
/// Ratio between grades.
const GRADE: f64 = 0.1;
/// Longest move of one iteration, in reaches.
const LONGEST: f64 = 0.3;
/// Longest moves at the most: guides that are out of parallel meet far away.
const FARTHEST: usize = 400;
/// Moves below this (in reaches) are the end of a grade...
const STILL: f64 = 1e-9;
/// ... and of the closing.
const SETTLED: f64 = 1e-14;
/// A closing whose moves no longer shrink has settled, if they are shorter than this.
const ROUNDING: f64 = 1e-11;
/// What is open by less (parts of sizes) is rounding.
const OPEN: f64 = 2e-15;

/// Which singular values of C count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cut {
    /// Those above a level; the others are null.
    Level(f64),
    /// So many of the largest.
    Rank(usize),
}

impl Cut {
    /// How many of these values count.
    pub fn count(self, values: &[f64]) -> usize {
        match self {
            Self::Level(level) => values.iter().filter(|s| **s > level).count(),
            Self::Rank(rank) => rank.min(values.len()),
        }
    }
}

/// What a closing did.
pub struct Closed {
    /// Largest part of its size by which a row stays open.
    pub open: f64,
    /// The move, in reaches, summed over the iterations.
    pub moved: Vec<f64>,
}

/// Null space of C at one position.
pub struct Motions {
    /// Pivots, descending.
    pub pivots: Vec<f64>,
    /// Motions that no row opposes, in reaches.
    pub motions: Vec<Vec<f64>>,
}

/// Null spaces of C at one position.
pub struct Nulls {
    /// Singular values, descending.
    pub values: Vec<f64>,
    /// Motions that no row opposes, in reaches.
    pub motions: Vec<Vec<f64>>,
    /// Self-stresses: combinations of rows, in parts of their sizes, that no motion feels.
    pub stresses: Vec<Vec<f64>>,
}

/// The closings of a system, drives released, at time t.
pub struct Kernel<'s, S: ConstrainedSystem> {
    /// The system.
    pub system: &'s S,
    t: f64,
    /// Holonomic rows that prescribe no motion.
    pub rows: Vec<usize>,
    /// What a large move opens each of them by.
    pub sizes: Vec<f64>,
    reach: Vec<f64>,
    scratch: S::Scratch,
    /// Phi of the system at the last position.
    pub phi: Vec<f64>,
    /// Values of its C there.
    pub c: Vec<f64>,
    a: Vec<f64>,
}

impl<'s, S: ConstrainedSystem> Kernel<'s, S> {
    /// `sizes` of rows that the system does not know are 1.
    pub fn new(system: &'s S, t: f64) -> Self {
        let size = system.size();
        let rows: Vec<usize> = (0..size.holonomic).filter(|&i| !system.row_is_drive(i)).collect();
        Self {
            sizes: rows.iter().map(|&i| system.row_reach(i).unwrap_or(1.0)).collect(),
            reach: (0..size.nv).map(|i| system.reach(i)).collect(),
            scratch: system.scratch(),
            phi: vec![0.0; size.holonomic],
            c: vec![0.0; system.pattern().nnz()],
            a: vec![0.0; size.rows],
            system,
            t,
            rows,
        }
    }

    /// Largest part of its size by which a row is open at q.
    pub fn open(&mut self, q: &[f64]) -> Result<f64, SystemError> {
        self.system.position(self.t, q, &mut self.scratch, &mut self.phi, &mut self.c, &mut self.a)?;
        let parts = self.rows.iter().zip(&self.sizes).map(|(&i, size)| (self.phi[i] / size).abs());
        Ok(parts.fold(0.0, |m: f64, x| if x.is_nan() { f64::INFINITY } else { m.max(x) }))
    }

    /// Velocities.
    pub fn velocities(&self) -> usize {
        self.reach.len()
    }

    /// Phi in parts of sizes, and C in natural sizes.                                                    (S3, S4)
    pub fn look(&mut self, q: &[f64]) -> Result<(Vec<f64>, Matrix), SystemError> {
        self.system.position(self.t, q, &mut self.scratch, &mut self.phi, &mut self.c, &mut self.a)?;
        let pattern = self.system.pattern();
        let mut c = Matrix::new(self.rows.len(), self.reach.len());
        for (place, (&row, size)) in self.rows.iter().zip(&self.sizes).enumerate() {
            let out = c.row_mut(place);
            pattern.row(row).for_each(|e| {
                let v = pattern.col_idx[e];
                out[v] = self.c[e] * self.reach[v] / size;
            });
        }
        let phi = self.rows.iter().zip(&self.sizes).map(|(&i, size)| self.phi[i] / size).collect();
        Ok((phi, c))
    }

    /// Singular values at q, and both null spaces.
    pub fn nulls(&mut self, q: &[f64], cut: Cut) -> Result<Nulls, SystemError> {
        let (_, c) = self.look(q)?;
        let (rows, n) = (c.rows(), c.cols());
        let Ok(f) = svd_full(&c) else { return Ok(Nulls { values: vec![0.0], motions: vec![], stresses: vec![] }) };
        let rank = cut.count(&f.s);
        let column = |x: &Matrix, j: usize| (0..x.rows()).map(|i| x[(i, j)]).collect::<Vec<f64>>();
        Ok(Nulls {
            motions: (rank..n).map(|j| column(&f.v, j)).collect(),
            stresses: (rank..rows).map(|j| column(&f.u, j)).collect(),
            values: f.s,
        })
    }

    /// Singular values at q, descending.
    pub fn values(&mut self, q: &[f64]) -> Result<Vec<f64>, SystemError> {
        let (_, c) = self.look(q)?;
        Ok(svd(&c).map_or_else(|_| vec![0.0], |f| f.s))
    }

    /// Pivots at q, and the motions that no row opposes: cheaper than singular values, for one position after the other.
    pub fn motions(&mut self, q: &[f64], cut: Cut) -> Result<Motions, SystemError> {
        let (_, c) = self.look(q)?;
        let n = c.cols();
        let mut pivots = Vec::new();
        let found = qr_null_space_by(&c, |all| {
            pivots = all.to_vec();
            cut.count(all)
        });
        let Ok(f) = found else { return Ok(Motions { pivots: vec![0.0], motions: vec![] }) };
        let column = |j: usize| (0..n).map(|i| f.null[(i, j)]).collect::<Vec<f64>>();
        Ok(Motions { motions: (0..f.null.cols()).map(column).collect(), pivots })
    }

    /// How far a move (in reaches) goes: the fastest coordinate, or what stands for it whatever the axes.
    pub fn travel(&self, y: &[f64]) -> f64 {
        self.system.travel(&self.in_velocities(y))
    }

    fn in_velocities(&self, y: &[f64]) -> Vec<f64> {
        y.iter().zip(&self.reach).map(|(y, reach)| y * reach).collect()
    }

    /// Move q by y, in reaches.
    pub fn step(&self, q: &mut [f64], y: &[f64]) {
        self.system.step(q, &self.in_velocities(y));
        self.system.normalise(q);
    }

    /// Gauss-Newton with all rows, dq = -C⁺ Phi by the pivots that count. What then stays open no motion of the level
    /// closes. `None` where the moves do not settle.                                                (11.9, 1)
    pub fn close(&mut self, q: &mut [f64], cut: Cut) -> Result<Option<Closed>, SystemError> {
        let last = match cut {
            Cut::Level(level) => level,
            Cut::Rank(_) => 0.0,
        };
        let mut grade = match cut {
            Cut::Level(level) => COARSE.max(level),
            Cut::Rank(_) => 0.0,
        };
        let (mut moved, mut before) = (vec![0.0; self.reach.len()], f64::INFINITY);
        let (mut far, mut near) = (0, 0);
        while far < FARTHEST && near < ITERATIONS {
            let (phi, c) = self.look(q)?;
            let open = phi.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            if open <= OPEN {
                return Ok(Some(Closed { open, moved }));
            }
            let against: Vec<f64> = phi.iter().map(|x| -x).collect();
            let keep = |diagonal: &[f64]| match cut {
                Cut::Level(_) => Cut::Level(grade).count(diagonal),
                Cut::Rank(_) => cut.count(diagonal),
            };
            let Ok((mut y, _)) = pivoted_least_norm(&c, &against, keep) else { return Ok(None) };
            let mut length = self.travel(&y);
            if !length.is_finite() {
                return Ok(None);
            }
            if length > LONGEST {
                far += 1;
                y.iter_mut().for_each(|y| *y *= LONGEST / length);
                length = LONGEST;
            } else {
                near += 1;
            }
            let finest = grade <= last;
            if finest && (length <= SETTLED || length < ROUNDING && length >= 0.5 * before) {
                return Ok(Some(Closed { open, moved }));
            }
            self.step(q, &y);
            moved.iter_mut().zip(&y).for_each(|(m, y)| *m += y);
            before = length;
            if !finest && length < STILL.max(1e-2 * grade) {
                (grade, before) = ((GRADE * grade).max(last), f64::INFINITY);
            }
        }
        Ok(None)
    }
}
