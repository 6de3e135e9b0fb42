//! Small convex programs: the point of a polyhedron that is nearest to another, and the one of least cost.
//!
//! ```text
//! min |x − x_0|²   so that   E x = b,   N x ≥ c
//! ```
//!
//! by the dual active-set method of Goldfarb and Idnani (1983), from the nearest point that satisfies the equations
//! alone: each step satisfies one more inequality, and the distance grows, so that no set of inequalities comes twice.
//! Dense, for some fifty unknowns.

use crate::dense::{self, Matrix};
use crate::tolerance;

/// Why there is no such point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProgramError {
    /// No point satisfies all conditions.
    #[error("the conditions contradict each other")]
    Infeasible,
    /// Equations depend on each other.
    #[error("the equations depend on each other")]
    Dependent,
    /// The method has not ended.
    #[error("the active-set method has not ended")]
    NoConvergence,
}

/// Conditions on a point: E x = b and N x ≥ c, one row each.
#[derive(Clone, Debug)]
pub struct Polyhedron {
    /// E.
    pub equations: Matrix,
    /// b.
    pub values: Vec<f64>,
    /// N.
    pub normals: Matrix,
    /// c.
    pub least: Vec<f64>,
}

/// Multiples of the rows that are taken as equations.
struct Active<'p> {
    of: &'p Polyhedron,
    /// Inequalities satisfied with equality.
    rows: Vec<usize>,
    /// Cholesky factor of the products of all active rows.
    factor: Vec<f64>,
}

impl<'p> Active<'p> {
    fn new(of: &'p Polyhedron, rows: Vec<usize>) -> Option<Self> {
        let mut new = Self { of, rows, factor: Vec::new() };
        let n = new.count();
        new.factor = (0..n * n).map(|e| dense::dot(new.row(e / n), new.row(e % n))).collect();
        dense::cholesky(&mut new.factor, n).ok().map(|()| new)
    }

    fn count(&self) -> usize {
        self.of.equations.rows() + self.rows.len()
    }

    fn row(&self, i: usize) -> &[f64] {
        let first = self.of.equations.rows();
        if i < first {
            self.of.equations.row(i)
        } else {
            self.of.normals.row(self.rows[i - first])
        }
    }

    fn value(&self, i: usize) -> f64 {
        let first = self.of.equations.rows();
        if i < first {
            self.of.values[i]
        } else {
            self.of.least[self.rows[i - first]]
        }
    }

    /// Multiples of the active rows whose sum is nearest to x.
    fn multiples(&self, x: &[f64]) -> Vec<f64> {
        let mut r: Vec<f64> = (0..self.count()).map(|i| dense::dot(self.row(i), x)).collect();
        dense::cholesky_solve(&self.factor, r.len(), &mut r);
        r
    }

    /// The nearest point to x at which all active rows are equations, and the multiples of the rows that lead there.
    fn nearest(&self, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut x, mut u) = (x.to_vec(), vec![0.0; self.count()]);
        for _ in 0..2 {
            // once more removes the rounding of the first
            let mut gap: Vec<f64> = (0..self.count()).map(|i| self.value(i) - dense::dot(self.row(i), &x)).collect();
            dense::cholesky_solve(&self.factor, gap.len(), &mut gap);
            gap.iter().enumerate().for_each(|(i, g)| dense::axpy(*g, self.row(i), &mut x));
            dense::axpy(1.0, &gap, &mut u);
        }
        (x, u)
    }
}

impl Polyhedron {
    /// The inequality that is violated most at x, over the length of its row and what is added up, `from` among it.
    fn violated(&self, x: &[f64], from: f64, active: &[usize]) -> Option<usize> {
        let part = |i: usize| {
            let row = self.normals.row(i);
            let terms = row.iter().zip(x).map(|(n, x)| (n * x).abs()).fold(self.least[i].abs(), f64::max);
            let (gap, length) = (self.least[i] - dense::dot(row, x), dense::dot(row, row).sqrt());
            if gap > tolerance::LONG_ROUNDING * terms.max(length * from) {
                gap / length
            } else {
                0.0
            }
        };
        let all = (0..self.least.len()).filter(|i| !active.contains(i)).map(|i| (i, part(i)));
        all.filter(|x| x.1 > 0.0).max_by(|x, y| x.1.total_cmp(&y.1)).map(|x| x.0)
    }

    /// The point that is nearest to x_0.
    ///
    /// # Errors
    /// Where there is none.
    pub fn nearest(&self, x0: &[f64]) -> Result<Vec<f64>, ProgramError> {
        self.nearest_with_pushing(x0).map(|found| found.0)
    }

    /// The same, and the inequalities that push there: with the equations they are independent, and no multiple of
    /// theirs is negative.
    ///
    /// # Errors
    /// As `nearest`.
    pub fn nearest_with_pushing(&self, x0: &[f64]) -> Result<(Vec<f64>, Vec<usize>), ProgramError> {
        let first = self.equations.rows();
        let mut active = Active::new(self, Vec::new()).ok_or(ProgramError::Dependent)?;
        let (mut x, mut u) = active.nearest(x0);
        let from = dense::dot(x0, x0).sqrt();
        for _ in 0..10 * (self.least.len() + x0.len() + 1) {
            let Some(p) = self.violated(&x, from, &active.rows) else {
                return Ok((active.nearest(x0).0, active.rows));
            };
            let (normal, mut own) = (self.normals.row(p), 0.0);
            loop {
                let r = active.multiples(normal);
                let mut z = normal.to_vec();
                r.iter().enumerate().for_each(|(i, r)| dense::axpy(-r, active.row(i), &mut z));
                let along = dense::dot(&z, &z);
                // how far until an inequality no longer pushes
                let blocking = (first..u.len())
                    .filter(|&i| r[i] > 0.0)
                    .map(|i| (i, u[i] / r[i]))
                    .min_by(|x, y| x.1.total_cmp(&y.1));
                let free = along > tolerance::LONG_ROUNDING * dense::dot(normal, normal);
                let full = if free { (self.least[p] - dense::dot(normal, &x)) / along } else { f64::INFINITY };
                let step = blocking.map_or(full, |b| b.1.min(full));
                if step.is_infinite() {
                    return Err(ProgramError::Infeasible);
                }
                if free {
                    dense::axpy(step, &z, &mut x);
                }
                u.iter_mut().zip(&r).for_each(|(u, r)| *u -= step * r);
                own += step;
                let mut rows = active.rows.clone();
                match blocking.filter(|b| b.1 < full) {
                    Some((leaves, _)) => {
                        rows.remove(leaves - first);
                        u.remove(leaves);
                    }
                    None => {
                        rows.push(p);
                        u.push(own);
                    }
                }
                let added = rows.len() > active.rows.len();
                active = Active::new(self, rows).ok_or(ProgramError::NoConvergence)?;
                if added {
                    break;
                }
            }
        }
        Err(ProgramError::NoConvergence)
    }

    /// A point of least cost f · x, reached from x_0 by steps to the nearest point of x − f: a linear program is solved
    /// by finitely many of them.
    ///
    /// # Errors
    /// As `nearest`.
    pub fn cheapest(&self, cost: &[f64], x0: &[f64]) -> Result<Vec<f64>, ProgramError> {
        let mut x = self.nearest(x0)?;
        for _ in 0..1000 {
            let wanted: Vec<f64> = x.iter().zip(cost).map(|(x, f)| x - f).collect();
            let next = self.nearest(&wanted)?;
            let size = next.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
            let moved = next.iter().zip(&x).fold(0.0, |m: f64, (x, y)| m.max((x - y).abs()));
            x = next;
            if moved <= tolerance::LONG_ROUNDING * size {
                return Ok(x);
            }
        }
        Err(ProgramError::NoConvergence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dense::samples::random;

    /// −1 ≤ x ≤ 1 with k random equations that have a solution there.
    fn cube(rng: &mut fastrand::Rng, k: usize, n: usize) -> Polyhedron {
        let equations = random(rng, k, n);
        let inside: Vec<f64> = (0..n).map(|_| 1.8 * rng.f64() - 0.9).collect();
        let values = equations.matvec(&inside);
        let mut normals = Matrix::new(2 * n, n);
        (0..n).for_each(|i| (normals[(i, i)], normals[(n + i, i)]) = (1.0, -1.0));
        Polyhedron { equations, values, normals, least: vec![-1.0; 2 * n] }
    }

    /// The nearest point of a convex set: no other is nearer, along every edge of a random walk in it.
    #[test]
    fn nearest_points_satisfy_the_conditions_of_optimality() {
        let mut rng = fastrand::Rng::with_seed(81);
        for (k, n) in [(0, 3), (1, 2), (2, 6), (5, 9), (10, 40)] {
            let p = cube(&mut rng, k, n);
            let x0: Vec<f64> = (0..n).map(|_| 6.0 * rng.f64() - 3.0).collect();
            let (x, pushing) = p.nearest_with_pushing(&x0).unwrap();
            assert!(p.equations.matvec(&x).iter().zip(&p.values).all(|(x, y)| (x - y).abs() < 1e-12));
            assert!(x.iter().all(|x| x.abs() < 1.0 + 1e-12));
            // x − x_0 = Eᵀ λ + u with u pushing inwards from the faces that it touches
            let active: Vec<usize> = (0..2 * n).filter(|&i| dense::dot(p.normals.row(i), &x) < -1.0 + 1e-11).collect();
            let own = Active::new(&p, active.clone()).unwrap();
            let away: Vec<f64> = x.iter().zip(&x0).map(|(x, y)| x - y).collect();
            let u = own.multiples(&away);
            let mut left = away;
            u.iter().enumerate().for_each(|(i, u)| dense::axpy(-u, own.row(i), &mut left));
            assert!(left.iter().all(|x| x.abs() < 1e-11), "{left:?}");
            assert!(u[k..].iter().all(|u| *u > -1e-11), "{u:?}");
            let pushes: Vec<usize> = active.iter().zip(&u[k..]).filter(|x| *x.1 > 1e-9).map(|x| *x.0).collect();
            assert!(pushes.iter().all(|i| pushing.contains(i)));
        }
    }

    /// Of two that oppose each other the one that pushes is named.
    #[test]
    fn what_opposes_does_not_push() {
        for sign in [1.0, -1.0] {
            let normals = Matrix::from_rows(&[&[1.0, 0.0], &[-1.0, 0.0]]);
            let (equations, values, least) = (Matrix::new(0, 2), Vec::new(), vec![0.0; 2]);
            let p = Polyhedron { equations, values, normals, least };
            let (x, pushing) = p.nearest_with_pushing(&[-sign, 3.0]).unwrap();
            assert_eq!((x, pushing), (vec![0.0, 3.0], vec![usize::from(sign < 0.0)]));
        }
    }

    /// The least largest component of solutions of one equation a · x = b is b / Σ|a|.
    #[test]
    fn the_least_largest_component() {
        let mut rng = fastrand::Rng::with_seed(82);
        for n in [1, 2, 5, 20] {
            let a = random(&mut rng, 1, n);
            let sum: f64 = a.data().iter().map(|x| x.abs()).sum();
            let mut equations = Matrix::new(1, n + 1);
            equations.row_mut(0)[..n].copy_from_slice(a.data());
            let mut normals = Matrix::new(2 * n, n + 1);
            for i in 0..n {
                (normals[(i, i)], normals[(n + i, i)]) = (1.0, -1.0);
                (normals[(i, n)], normals[(n + i, n)]) = (1.0, 1.0);
            }
            let p = Polyhedron { equations, values: vec![1.0], normals, least: vec![0.0; 2 * n] };
            let mut cost = vec![0.0; n + 1];
            cost[n] = 1.0;
            let x = p.cheapest(&cost, &vec![0.0; n + 1]).unwrap();
            assert!((x[n] * sum - 1.0).abs() < 1e-12, "{n}: {} {}", x[n], 1.0 / sum);
        }
    }

    #[test]
    fn what_contradicts_itself_is_refused() {
        let mut p = cube(&mut fastrand::Rng::with_seed(83), 1, 3);
        p.values = vec![100.0];
        assert_eq!(p.nearest(&[0.0; 3]), Err(ProgramError::Infeasible));
        p.equations = Matrix::from_rows(&[&[1.0, 1.0, 0.0], &[2.0, 2.0, 0.0]]);
        p.values = vec![1.0, 2.0];
        assert_eq!(p.nearest(&[0.0; 3]), Err(ProgramError::Dependent));
    }
}
