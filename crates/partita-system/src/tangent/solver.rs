//! P1-P3 with a block-triangular C_D: kinematic differentials block by block, no system over all loops.      (8.3)

use crate::closing::Block;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense;

/// The blocks of a closing as a solver for C_D: forwards for rates of the unknowns, backwards for multipliers.
///
/// Cost of a solve: Σ s³/3 for blocks of s unknowns, and one product per entry of C and right-hand side.
pub(super) struct BlockSolver {
    parts: Vec<Part>,
    /// Length of the longest block's rows times columns.
    work: Vec<f64>,
}

/// One block: `C[rows, unknown]` factored, and what its rows take over from inputs and earlier blocks.
struct Part {
    rows: Vec<usize>,
    unknown: Vec<usize>,
    factor: Vec<f64>,
    pivots: Vec<usize>,
    /// (row in the block, entry of C, column in the block).
    own: Vec<(usize, usize, usize)>,
    /// (row in the block, entry of C, velocity): inputs and unknowns of earlier blocks.
    known: Vec<(usize, usize, usize)>,
}

impl BlockSolver {
    /// Take over blocks in order of solution, for k inputs, and check that C_D is block-triangular.
    ///
    /// `c` are the values of C in pattern order: an entry of a later unknown must be zero.
    pub(super) fn new<S: ConstrainedSystem>(
        system: &S,
        inputs: &[usize],
        blocks: &[Block],
        rank: usize,
        c: &[f64],
    ) -> Result<Self, SystemError> {
        let (size, pattern) = (system.size(), system.pattern());
        let refuse = |what: String| {
            Err(SystemError::Request(format!("the explicit closing cannot be used: {what}; take another formulation")))
        };
        let mut solved = vec![false; size.nv];
        inputs.iter().for_each(|&i| solved[i] = true);
        let mut parts: Vec<Part> = Vec::with_capacity(blocks.len());
        for block in blocks {
            if block.rows.len() != block.unknown.len() {
                let (r, u) = (block.rows.len(), block.unknown.len());
                return refuse(format!("{} has {r} rows for {u} unknown velocities", block.words));
            }
            if let Some(&i) = block.unknown.iter().find(|&&i| solved[i]) {
                return refuse(format!(
                    "{} solves for {}, which is known already",
                    block.words,
                    system.velocity_name(i)
                ));
            }
            let (mut own, mut known) = (Vec::new(), Vec::new());
            for (i, &row) in block.rows.iter().enumerate() {
                for e in pattern.row(row) {
                    let v = pattern.col_idx[e];
                    if let Some(j) = block.unknown.iter().position(|&u| u == v) {
                        own.push((i, e, j));
                    } else if solved[v] {
                        known.push((i, e, v));
                    } else if c[e] != 0.0 {
                        let (row, v) = (system.row_name(row), system.velocity_name(v));
                        return refuse(format!("{}: {row} contains {v}, which is solved for later", block.words));
                    }
                }
            }
            block.unknown.iter().for_each(|&i| solved[i] = true);
            let s = block.rows.len();
            parts.push(Part {
                rows: block.rows.clone(),
                unknown: block.unknown.clone(),
                factor: vec![0.0; s * s],
                pivots: vec![0; s],
                own,
                known,
            });
        }
        if let Some(i) = solved.iter().position(|s| !s) {
            return refuse(format!("no block solves for {}", system.velocity_name(i)));
        }
        let total: usize = parts.iter().map(|p| p.rows.len()).sum();
        if total != rank {
            return refuse(format!("its blocks have {total} rows, but the constraints have rank {rank}"));
        }
        let most = parts.iter().map(|p| p.rows.len()).max().unwrap_or(0);
        Ok(Self { parts, work: vec![0.0; most] })
    }

    /// Unknown velocities in order of solution.
    pub(super) fn unknown(&self) -> impl Iterator<Item = usize> + '_ {
        self.parts.iter().flat_map(|p| p.unknown.iter().copied())
    }

    /// Rows in order of solution.
    pub(super) fn rows(&self) -> impl Iterator<Item = usize> + '_ {
        self.parts.iter().flat_map(|p| p.rows.iter().copied())
    }

    /// Factor the blocks of C; the block that is singular, if one is.
    pub(super) fn factor(&mut self, c: &[f64]) -> Result<(), usize> {
        for (b, p) in self.parts.iter_mut().enumerate() {
            let s = p.rows.len();
            p.factor.fill(0.0);
            for &(i, e, j) in &p.own {
                p.factor[i * s + j] = c[e];
            }
            dense::lu(&mut p.factor, s, &mut p.pivots).map_err(|_| b)?;
        }
        Ok(())
    }

    /// Forwards: entry `place(i)` of `x` for each unknown velocity i, with `C x + right = 0` in the blocks' rows and the
    /// entries of the inputs given.
    pub(super) fn forward(
        &mut self,
        c: &[f64],
        x: &mut [f64],
        place: impl Fn(usize) -> usize,
        right: impl Fn(usize) -> f64,
    ) {
        for p in &self.parts {
            let s = p.rows.len();
            let rhs = &mut self.work[..s];
            rhs.iter_mut().zip(&p.rows).for_each(|(y, &row)| *y = -right(row));
            for &(i, e, v) in &p.known {
                rhs[i] -= c[e] * x[place(v)];
            }
            dense::lu_solve(&p.factor, s, &p.pivots, rhs);
            rhs.iter().zip(&p.unknown).for_each(|(y, &u)| x[place(u)] = *y);
        }
    }

    /// Smallest singular value of C_D, rows and unknowns measured in reaches, by inverse iteration with the factors at
    /// hand: two solves forwards and one backwards. `x` (nv) and `y` (rows) are room.
    pub(super) fn smallest_singular_value<S: ConstrainedSystem>(
        &mut self,
        system: &S,
        c: &[f64],
        x: &mut [f64],
        y: &mut [f64],
    ) -> f64 {
        y.fill(0.0);
        // irregular, so that no self-stress of a mechanism is orthogonal to it
        self.rows().for_each(|row| y[row] = 1.0 + 0.5 * (row as f64 * 1.7).sin());
        let (mut given, mut answer) = (1.0, 1.0);
        for forwards in [true, false, true] {
            if forwards {
                given = dense::dot(y, y);
                self.rows().for_each(|i| y[i] *= system.row_reach(i).unwrap_or(1.0));
                x.fill(0.0);
                self.forward(c, x, |i| i, |row| -y[row]);
                self.unknown().for_each(|i| x[i] /= system.reach(i));
                answer = dense::dot(x, x);
            } else {
                self.unknown().for_each(|i| x[i] /= system.reach(i));
                self.backward(c, x, y);
                self.rows().for_each(|i| y[i] *= system.row_reach(i).unwrap_or(1.0));
            }
        }
        (given / answer).sqrt()
    }

    /// Backwards: λ with `C_Dᵀ λ = f_D`; `f` (nv) is used up.                               (43)
    pub(super) fn backward(&mut self, c: &[f64], f: &mut [f64], lambda: &mut [f64]) {
        for p in self.parts.iter().rev() {
            let s = p.rows.len();
            let y = &mut self.work[..s];
            y.iter_mut().zip(&p.unknown).for_each(|(y, &u)| *y = f[u]);
            dense::lu_solve_transposed(&p.factor, s, &p.pivots, y);
            for &(i, e, v) in &p.known {
                f[v] -= c[e] * y[i];
            }
            p.rows.iter().zip(y.iter()).for_each(|(&row, y)| lambda[row] = *y);
        }
    }
}
