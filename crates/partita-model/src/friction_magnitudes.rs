//! The magnitudes of reaction-dependent frictions, consistent with their reactions: a system as small as the number of
//! such frictions.
//!
//! Reactions are affine in the efforts f of the frictions. With `R_t = A_t + Σ_j B_tj f_j` (forces, one a term) and
//! `N_i = base_i + Σ_t weight_t |R_t|` over the terms of friction i, the efforts are those with
//!
//! ```text
//! f_i + κ_i N_i(f) = 0                                                                          (G1)
//! ```
//! where κ_i is the coefficient at the speed there, with its sign. There is one solution for every load if `1 + κ_i Σ_t
//! weight_t u_t · B_tj` is regular for all vectors |u_t| ≤ 1: then (G1) is a homeomorphism (Hadamard). That is so where
//! the matrix `|κ_i| Σ_t weight_t |B_tj|` is a contraction; and where every R_t keeps to one line, so that u_t is a
//! number between −1 and 1, as soon as the determinant, which is affine in each of them, is positive in all corners.

use crate::wrench::Wrench;
use partita_math::dense;
use partita_math::tolerance;

/// Maximum number of terms for which corners are counted.
const MOST_TERMS: usize = 12;
/// Maximum number of Newton steps; where there is one solution, some ten suffice.
const MOST_STEPS: usize = 200;
/// Memory of an evaluation.
#[derive(Clone, Debug, Default)]
pub(crate) struct Hold {
    pub phi: Vec<f64>,
    pub c: Vec<f64>,
    pub a: Vec<f64>,
    pub b: Vec<f64>,
    pub mass: Vec<f64>,
    /// Right-hand sides; later the accelerations.
    pub y: Vec<f64>,
    /// Rows in the mass metric, each of length 1.
    pub w: Vec<f64>,
    pub scale: Vec<f64>,
    pub gram: Vec<f64>,
    pub perm: Vec<usize>,
    pub x: Vec<f64>,
    pub lambda: Vec<f64>,
    pub still: Vec<f64>,
    pub conditions: OfConditions,
    pub magnitudes: FrictionMagnitudes,
}

/// What the conditions of joints and their drives add to reactions.
#[derive(Clone, Debug, Default)]
pub(crate) struct OfConditions {
    /// Effort along each velocity of the tree.
    pub own: Vec<f64>,
    /// For each friction, on the child of its joint, about the origin of the tree's world.
    pub wrenches: Vec<Wrench>,
}

/// A force that determines a friction.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Term {
    /// Which friction.
    pub of: usize,
    /// Its arm.
    pub weight: f64,
    /// Without frictions.
    pub a: [f64; 3],
}

/// Why there are no magnitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Jam {
    /// The friction that contracts least.
    pub which: usize,
    /// Amplification of a unit of its effort.
    pub returned: f64,
}

/// The small system and its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct FrictionMagnitudes {
    /// κ.
    pub kappa: Vec<f64>,
    /// Normal force that does not depend on the reaction.
    pub base: Vec<f64>,
    pub terms: Vec<Term>,
    /// B: terms x frictions.
    pub b: Vec<[f64; 3]>,
    /// Efforts.
    pub f: Vec<f64>,
    /// N.
    pub normal: Vec<f64>,
    open: Vec<f64>,
    tried: Vec<f64>,
    step: Vec<f64>,
    matrix: Vec<f64>,
}

fn dot(x: &[f64; 3], y: &[f64; 3]) -> f64 {
    x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
}

fn size(x: &[f64; 3]) -> f64 {
    dot(x, x).sqrt()
}

impl FrictionMagnitudes {
    /// Memory for so many frictions with so many terms.
    pub fn fit(&mut self, frictions: usize, terms: usize) {
        for x in [
            &mut self.kappa,
            &mut self.base,
            &mut self.f,
            &mut self.normal,
            &mut self.open,
            &mut self.tried,
            &mut self.step,
        ] {
            x.resize(frictions, 0.0);
        }
        self.terms.resize(terms, Term::default());
        self.b.resize(terms * frictions, [0.0; 3]);
        self.matrix.resize(frictions * frictions, 0.0);
    }

    /// R_t at efforts f.
    fn force(&self, t: usize, f: &[f64]) -> [f64; 3] {
        let n = f.len();
        let mut r = self.terms[t].a;
        for (b, f) in self.b[t * n..(t + 1) * n].iter().zip(f) {
            (0..3).for_each(|c| r[c] += b[c] * f);
        }
        r
    }

    /// N at efforts f.
    fn normals(&self, f: &[f64], out: &mut [f64]) {
        out.copy_from_slice(&self.base);
        for (t, term) in self.terms.iter().enumerate() {
            out[term.of] += term.weight * size(&self.force(t, f));
        }
    }

    /// `sign + κ_i Σ_t weight_t ∂(t, j)`.
    fn fill(&mut self, sign: f64, absolute: bool, part: impl Fn(usize, &[f64; 3]) -> f64) {
        let n = self.kappa.len();
        self.matrix.fill(0.0);
        for i in 0..n {
            self.matrix[i * n + i] = 1.0;
        }
        for (t, term) in self.terms.iter().enumerate() {
            let kappa = self.kappa[term.of];
            let factor = sign * term.weight * if absolute { kappa.abs() } else { kappa };
            for j in 0..n {
                self.matrix[term.of * n + j] += factor * part(t, &self.b[t * n + j]);
            }
        }
    }

    /// Whether elimination without pivoting meets a pivot that is not positive. A matrix without positive entries off
    /// the diagonal is an M-matrix if it does not.
    fn fails(&mut self) -> bool {
        let n = self.kappa.len();
        let m = &mut self.matrix;
        for k in 0..n {
            let pivot = m[k * n + k];
            if pivot.is_nan() || pivot <= 0.0 {
                return true;
            }
            for i in k + 1..n {
                let factor = m[i * n + k] / pivot;
                for j in k + 1..n {
                    m[i * n + j] -= factor * m[k * n + j];
                }
            }
        }
        false
    }

    /// The determinant, with pivoting.
    fn determinant(&mut self) -> f64 {
        let n = self.kappa.len();
        let m = &mut self.matrix;
        let mut found = 1.0;
        for k in 0..n {
            let best = (k..n).fold(k, |b, i| if m[i * n + k].abs() > m[b * n + k].abs() { i } else { b });
            if best != k {
                (0..n).for_each(|j| m.swap(best * n + j, k * n + j));
                found = -found;
            }
            let pivot = m[k * n + k];
            found *= pivot;
            if pivot == 0.0 {
                return 0.0;
            }
            for i in k + 1..n {
                let factor = m[i * n + k] / pivot;
                for j in k + 1..n {
                    m[i * n + j] -= factor * m[k * n + j];
                }
            }
        }
        found
    }

    /// The line of a term, if its direction is fixed: that of its largest part.
    fn line(&self, t: usize) -> Option<[f64; 3]> {
        let n = self.kappa.len();
        let all = || self.b[t * n..(t + 1) * n].iter();
        let largest = all().fold([0.0; 3], |m: [f64; 3], x| if size(x) > size(&m) { *x } else { m });
        let length = size(&largest);
        if length == 0.0 {
            return Some(largest);
        }
        let e = largest.map(|x| x / length);
        let off = |x: &[f64; 3]| {
            let along = dot(x, &e);
            size(&[x[0] - along * e[0], x[1] - along * e[1], x[2] - along * e[2]])
        };
        all().all(|x| off(x) <= tolerance::EQUAL * length).then_some(e)
    }

    /// Whether there is one solution for every load.
    fn single(&mut self) -> bool {
        self.fill(-1.0 - tolerance::NEGLIGIBLE, true, |_, b| size(b));
        if !self.fails() {
            return true;
        }
        let terms = self.terms.len();
        let mut lines = [[0.0; 3]; MOST_TERMS];
        if terms > MOST_TERMS {
            return false;
        }
        for t in 0..terms {
            match self.line(t) {
                Some(e) => lines[t] = e,
                None => return false,
            }
        }
        (0..1usize << terms).all(|corner| {
            let sign = |t: usize| if corner >> t & 1 == 1 { 1.0 } else { -1.0 };
            self.fill(1.0, false, |t, b| sign(t) * dot(&lines[t], b));
            self.determinant() > tolerance::NEGLIGIBLE
        })
    }

    /// The friction with the largest amplification of its own effort.
    fn worst(&self) -> Jam {
        let n = self.kappa.len();
        let mut jam = Jam { which: 0, returned: 0.0 };
        for i in 0..n {
            let own = self.terms.iter().enumerate().filter(|(_, x)| x.of == i);
            let returned = own.map(|(t, x)| x.weight * size(&self.b[t * n + i])).sum::<f64>() * self.kappa[i].abs();
            if returned.is_nan() || returned > jam.returned {
                jam = Jam { which: i, returned };
            }
        }
        jam
    }

    /// Residual of (G1) at `tried`, and the terms there.
    fn residual(&mut self) -> (f64, f64) {
        let tried = std::mem::take(&mut self.tried);
        let mut normal = std::mem::take(&mut self.normal);
        self.normals(&tried, &mut normal);
        let (mut worst, mut scale) = (0.0f64, 0.0f64);
        for (i, f) in tried.iter().enumerate() {
            let friction = self.kappa[i] * normal[i];
            self.open[i] = f + friction;
            worst = worst.max(self.open[i].abs());
            scale = scale.max(f.abs()).max(friction.abs());
        }
        (self.tried, self.normal) = (tried, normal);
        (worst, scale)
    }

    /// Efforts and magnitudes of (G1), by Newton's method from zero effort: the iteration does not depend on earlier
    /// solutions.
    pub fn solve(&mut self) -> Result<(), Jam> {
        if !self.single() {
            return Err(self.worst());
        }
        let n = self.kappa.len();
        self.f.fill(0.0);
        self.tried.fill(0.0);
        let (mut worst, mut scale) = self.residual();
        for _ in 0..MOST_STEPS {
            // exact to the last digits: one more step gains nothing
            if worst <= tolerance::ROUNDING * scale {
                break;
            }
            let f = std::mem::take(&mut self.f);
            let mut u = [0.0; 3];
            let mut matrix = std::mem::take(&mut self.matrix);
            matrix.fill(0.0);
            for i in 0..n {
                matrix[i * n + i] = 1.0;
            }
            for (t, term) in self.terms.iter().enumerate() {
                let r = self.force(t, &f);
                let length = size(&r);
                if length > 0.0 {
                    (0..3).for_each(|c| u[c] = r[c] / length);
                    for j in 0..n {
                        matrix[term.of * n + j] += self.kappa[term.of] * term.weight * dot(&u, &self.b[t * n + j]);
                    }
                }
            }
            self.step.copy_from_slice(&self.open);
            let regular = solve_small(&mut matrix, n, &mut self.step);
            self.matrix = matrix;
            self.f = f;
            if !regular {
                return Err(self.worst());
            }
            let (mut part, mut better) = (1.0, false);
            for _ in 0..30 {
                for i in 0..n {
                    self.tried[i] = self.f[i] - part * self.step[i];
                }
                let (now, size) = self.residual();
                if now < worst {
                    (worst, scale, better) = (now, size, true);
                    break;
                }
                part *= 0.5;
            }
            if !better {
                self.tried.copy_from_slice(&self.f);
                (worst, scale) = self.residual();
                break;
            }
            self.f.copy_from_slice(&self.tried);
        }
        match worst <= tolerance::LONG_ROUNDING * scale {
            true => Ok(()),
            false => Err(self.worst()), // NaN too
        }
    }
}

/// `x ← A⁻¹ x` with pivoting; false where A is singular.
fn solve_small(a: &mut [f64], n: usize, x: &mut [f64]) -> bool {
    for k in 0..n {
        let best = (k..n).fold(k, |b, i| if a[i * n + k].abs() > a[b * n + k].abs() { i } else { b });
        if best != k {
            (0..n).for_each(|j| a.swap(best * n + j, k * n + j));
            x.swap(best, k);
        }
        let pivot = a[k * n + k];
        if pivot == 0.0 || pivot.is_nan() {
            return false;
        }
        for i in k + 1..n {
            let factor = a[i * n + k] / pivot;
            for j in k + 1..n {
                a[i * n + j] -= factor * a[k * n + j];
            }
            x[i] -= factor * x[k];
        }
    }
    for k in (0..n).rev() {
        let known = dense::dot(&a[k * n + k + 1..(k + 1) * n], &x[k + 1..n]);
        x[k] = (x[k] - known) / a[k * n + k];
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One friction, one force a + b f across.
    fn one(kappa: f64, a: [f64; 3], b: [f64; 3]) -> FrictionMagnitudes {
        let mut x = FrictionMagnitudes::default();
        x.fit(1, 1);
        x.kappa[0] = kappa;
        x.terms[0] = Term { of: 0, weight: 1.0, a };
        x.b[0] = b;
        x
    }

    #[test]
    fn one_friction_is_the_closed_form() {
        // f = −κ |1 + b f|: −κ/(1 + κ b) while the bracket is positive
        for (kappa, b) in [(0.3, 0.9), (0.3, -0.9), (-0.3, 2.0), (-0.9, 1.05), (0.9, -1.05)] {
            let mut x = one(kappa, [0.0, 1.0, 0.0], [0.0, b, 0.0]);
            x.solve().unwrap();
            let exact = -kappa / (1.0 + kappa * b);
            assert!((x.f[0] - exact).abs() < 1e-14 * exact.abs(), "{} {exact}", x.f[0]);
            assert!((x.normal[0] - (1.0 + b * x.f[0]).abs()).abs() < 1e-14 * x.normal[0]);
        }
    }

    #[test]
    fn a_force_across_in_two_directions() {
        // f² = κ² (1 + b² f²)
        let (kappa, b) = (0.8, 1.1);
        let mut x = one(kappa, [1.0, 0.0, 0.0], [0.0, b, 0.0]);
        x.solve().unwrap();
        assert!((x.f[0] + kappa / (1.0 - (kappa * b).powi(2)).sqrt()).abs() < 1e-14);
    }

    #[test]
    fn what_returns_more_than_itself_is_reported() {
        for kappa in [0.6, -0.6] {
            // one direction has no solution, the other two
            let jam = one(kappa, [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]).solve().unwrap_err();
            assert!(jam.which == 0 && (jam.returned - 1.2).abs() < 1e-15);
        }
    }

    #[test]
    fn two_frictions_that_no_contraction_shows_to_be_single() {
        let mut x = FrictionMagnitudes::default();
        x.fit(2, 2);
        x.kappa.copy_from_slice(&[1.0, 1.0]);
        x.terms[0] = Term { of: 0, weight: 1.0, a: [0.0, 1.0, 0.0] };
        x.terms[1] = Term { of: 1, weight: 1.0, a: [0.0, 2.0, 0.0] };
        x.b.copy_from_slice(&[[0.0, 0.9, 0.0], [0.0, 0.9, 0.0], [0.0, 0.9, 0.0], [0.0, 0.9, 0.0]]);
        // determinant (1 ± .9)(1 ± .9) ∓ .81: 0.01 − 0.81 where both are negative and equal
        assert!(x.solve().is_err());
        x.b.copy_from_slice(&[[0.0, 0.5, 0.0], [0.0, 0.9, 0.0], [0.0, 0.0, 0.0], [0.0, 0.9, 0.0]]);
        x.solve().unwrap();
        let exact_2 = -2.0 / 1.9;
        let exact_1 = -(1.0 + 0.9 * exact_2) / 1.5;
        assert!((x.f[1] - exact_2).abs() < 1e-14 && (x.f[0] - exact_1).abs() < 1e-14, "{:?}", x.f);
        // two that press each other alone
        let mut x = FrictionMagnitudes::default();
        x.fit(2, 2);
        x.kappa.copy_from_slice(&[1.0, 0.5]);
        x.terms[0] = Term { of: 0, weight: 1.0, a: [0.0, 1.0, 0.0] };
        x.terms[1] = Term { of: 1, weight: 1.0, a: [0.0, 1.0, 0.0] };
        x.b.copy_from_slice(&[[0.0; 3], [0.0, 1.5, 0.0], [0.0, 1.5, 0.0], [0.0; 3]]);
        // |κ₁ κ₂ 1.5²| = 1.125: some corner is singular or turned over, and it is reported
        assert!(x.solve().is_err());
    }
}
