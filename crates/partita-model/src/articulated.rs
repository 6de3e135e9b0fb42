//! Articulated inertias: `M⁻¹` without M, in time proportional to the number of links.
//!
//! Inward, the inertia felt at each link with everything it carries free to move; outward, the compliance `Y` of each
//! link. `[M⁻¹]_ii = D_i⁻¹ + K_iᵀ Y_parent K_i` needs no column of M⁻¹. (Featherstone 2008; Kreutz-Delgado, Jain,
//! Rodriguez 1992.)

use crate::tree::{LinkMotion, Tree, TreeScratch};
use partita_math::dense;
use partita_math::spatial::Space;

/// Room for the recursion: plain numbers, DIM x DIM a link.
#[derive(Clone, Debug, Default)]
pub struct Articulated {
    inertia: Vec<f64>,
    /// S (DIM x 3) and K = U D⁻¹ (DIM x 3) of each link.
    axes: Vec<f64>,
    gain: Vec<f64>,
    /// D⁻¹ (3 x 3) of each link.
    inverse: Vec<f64>,
    compliance: Vec<f64>,
    force: Vec<f64>,
    motion: Vec<f64>,
}

/// `X` of a link: its twist is `X` times its parent's. Rows and columns turns first.
fn shift<G: Space>(arm: [f64; 3], out: &mut [f64]) {
    let d = G::DIM;
    out[..d * d].fill(0.0);
    for i in 0..d {
        out[i * d + i] = 1.0;
    }
    let [x, y, z] = arm;
    if d == 6 {
        // u + w × r
        let m = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]];
        for i in 0..3 {
            out[(3 + i) * 6..(3 + i) * 6 + 3].copy_from_slice(&m[i]);
        }
    } else {
        out[3] = -y;
        out[6] = x;
    }
}

/// `out += Xᵀ M X` (`by_rows` false) or `out += X M Xᵀ` (true).
fn congruence(x: &[f64], m: &[f64], d: usize, by_rows: bool, out: &mut [f64]) {
    let mut half = [0.0; 36];
    let at = |i: usize, j: usize| if by_rows { x[i * d + j] } else { x[j * d + i] };
    for i in 0..d {
        for j in 0..d {
            half[i * d + j] = (0..d).map(|l| at(i, l) * m[l * d + j]).sum();
        }
    }
    for i in 0..d {
        for j in 0..d {
            out[i * d + j] += (0..d).map(|l| half[i * d + l] * at(j, l)).sum::<f64>();
        }
    }
}

impl<G: Space> Tree<G> {
    fn freedoms(&self, i: usize) -> usize {
        if matches!(self.links[i].motion, LinkMotion::Ball) {
            3
        } else {
            1
        }
    }

    fn arm_from_parent(&self, i: usize, s: &TreeScratch<G>) -> [f64; 3] {
        let x = &s.links[i];
        G::vec_to(match self.links[i].motion {
            LinkMotion::Slide(_) => x.arm_in,
            _ => x.arm_in + x.arm_out,
        })
    }

    /// Inward sweep at the last poses and inertias. Fails with the velocity that moves no inertia and its pivot.
    pub fn articulate(&self, s: &mut TreeScratch<G>) -> Result<(), (usize, f64)> {
        let (n, d) = (self.links.len(), G::DIM);
        let mut a = std::mem::take(&mut s.articulated);
        a.inertia.resize(n * d * d, 0.0);
        a.axes.resize(n * d * 3, 0.0);
        a.gain.resize(n * d * 3, 0.0);
        a.inverse.resize(n * 9, 0.0);
        for i in 0..n {
            G::inertia_matrix(&s.links[i].inertia, self.links[i].mass, &mut a.inertia[i * d * d..(i + 1) * d * d]);
        }
        let mut failed = None;
        for i in (1..n).rev() {
            let f = self.freedoms(i);
            let axes = &mut a.axes[i * d * 3..(i + 1) * d * 3];
            for j in 0..f {
                let v = self.links[i].v + j;
                let one = |w: usize| G::S::from_f64_bool(w == v);
                let (w, u) = self.carry(i, s, G::Ang::default(), G::Vec::default(), one);
                let mut twist = [0.0; 6];
                G::twist_to(w, u, &mut twist);
                for l in 0..d {
                    axes[l * 3 + j] = twist[l];
                }
            }
            let (before, rest) = a.inertia.split_at_mut(i * d * d);
            let own = &mut rest[..d * d];
            let mut u = [0.0; 18];
            for l in 0..d {
                for j in 0..f {
                    u[l * 3 + j] = (0..d).map(|m| own[l * d + m] * axes[m * 3 + j]).sum();
                }
            }
            let mut pivot = [0.0; 9];
            for j in 0..f {
                for l in 0..f {
                    pivot[j * f + l] = (0..d).map(|m| axes[m * 3 + j] * u[m * 3 + l]).sum();
                }
            }
            // what the free motion feels, against what it would feel with everything it carries locked
            let largest = (0..f).fold(0.0, |m: f64, j| m.max(pivot[j * f + j]));
            if largest <= 0.0 || largest.is_nan() || dense::cholesky(&mut pivot[..f * f], f).is_err() {
                failed = Some((self.links[i].v, largest));
                break;
            }
            let inverse = &mut a.inverse[i * 9..(i + 1) * 9];
            dense::inverse_from_cholesky(&pivot[..f * f], f, &mut inverse[..f * f]);
            let gain = &mut a.gain[i * d * 3..(i + 1) * d * 3];
            for l in 0..d {
                for j in 0..f {
                    gain[l * 3 + j] = (0..f).map(|m| u[l * 3 + m] * inverse[m * f + j]).sum();
                }
            }
            for l in 0..d {
                for m in 0..d {
                    own[l * d + m] -= (0..f).map(|j| gain[l * 3 + j] * u[m * 3 + j]).sum::<f64>();
                }
            }
            let p = self.links[i].parent;
            if p > 0 {
                let mut x = [0.0; 36];
                shift::<G>(self.arm_from_parent(i, s), &mut x);
                congruence(&x, own, d, false, &mut before[p * d * d..(p + 1) * d * d]);
            }
        }
        s.articulated = a;
        failed.map_or(Ok(()), Err)
    }

    /// Diagonal of `M⁻¹` after [`articulate`](Self::articulate).
    pub fn inverse_mass_diagonal(&self, s: &mut TreeScratch<G>, out: &mut [f64]) {
        let (n, d) = (self.links.len(), G::DIM);
        let mut a = std::mem::take(&mut s.articulated);
        a.compliance.resize(n * d * d, 0.0);
        a.compliance.fill(0.0);
        for i in 1..n {
            let f = self.freedoms(i);
            let (p, v) = (self.links[i].parent, self.links[i].v);
            let mut x = [0.0; 36];
            shift::<G>(self.arm_from_parent(i, s), &mut x);
            let mut y = [0.0; 36]; // X Y_p Xᵀ
            congruence(&x, &a.compliance[p * d * d..(p + 1) * d * d], d, true, &mut y);
            let (axes, gain) = (&a.axes[i * d * 3..], &a.gain[i * d * 3..]);
            let inverse = &a.inverse[i * 9..];
            for j in 0..f {
                let carried: f64 =
                    (0..d).map(|l| gain[l * 3 + j] * (0..d).map(|m| y[l * d + m] * gain[m * 3 + j]).sum::<f64>()).sum();
                out[v + j] = inverse[j * f + j] + carried;
            }
            // Y = (1 − S Kᵀ) X Y_p Xᵀ (1 − S Kᵀ)ᵀ + S D⁻¹ Sᵀ
            let mut through = [0.0; 36];
            for l in 0..d {
                for m in 0..d {
                    through[l * d + m] =
                        f64::from(u8::from(l == m)) - (0..f).map(|j| axes[l * 3 + j] * gain[m * 3 + j]).sum::<f64>();
                }
            }
            let own = &mut a.compliance[i * d * d..(i + 1) * d * d];
            congruence(&through, &y, d, true, own);
            for l in 0..d {
                for m in 0..d {
                    for j in 0..f {
                        for h in 0..f {
                            own[l * d + m] += axes[l * 3 + j] * inverse[j * f + h] * axes[m * 3 + h];
                        }
                    }
                }
            }
        }
        s.articulated = a;
    }

    /// `M⁻¹ e_c` after [`articulate`](Self::articulate).
    pub fn inverse_mass_column(&self, c: usize, s: &mut TreeScratch<G>, out: &mut [f64]) {
        let (n, d) = (self.links.len(), G::DIM);
        let mut a = std::mem::take(&mut s.articulated);
        a.force.resize(n * d, 0.0);
        a.motion.resize(n * d, 0.0);
        a.force.fill(0.0);
        a.motion.fill(0.0);
        let mut x = [0.0; 36];
        let mut left = vec![[0.0; 3]; n];
        for i in (1..n).rev() {
            let f = self.freedoms(i);
            let v = self.links[i].v;
            let (axes, gain) = (&a.axes[i * d * 3..], &a.gain[i * d * 3..]);
            for j in 0..f {
                let pushed: f64 = (0..d).map(|l| axes[l * 3 + j] * a.force[i * d + l]).sum();
                left[i][j] = f64::from(u8::from(v + j == c)) - pushed;
            }
            let p = self.links[i].parent;
            if p > 0 {
                shift::<G>(self.arm_from_parent(i, s), &mut x);
                for m in 0..d {
                    let sum: f64 = (0..d)
                        .map(|l| {
                            let own = a.force[i * d + l] + (0..f).map(|j| gain[l * 3 + j] * left[i][j]).sum::<f64>();
                            x[l * d + m] * own
                        })
                        .sum();
                    a.force[p * d + m] += sum;
                }
            }
        }
        for i in 1..n {
            let f = self.freedoms(i);
            let (p, v) = (self.links[i].parent, self.links[i].v);
            let (axes, gain, inverse) = (&a.axes[i * d * 3..], &a.gain[i * d * 3..], &a.inverse[i * 9..]);
            shift::<G>(self.arm_from_parent(i, s), &mut x);
            let mut moved = [0.0; 6];
            for l in 0..d {
                moved[l] = (0..d).map(|m| x[l * d + m] * a.motion[p * d + m]).sum();
            }
            for j in 0..f {
                let own: f64 = (0..f).map(|h| inverse[j * f + h] * left[i][h]).sum();
                out[v + j] = own - (0..d).map(|l| gain[l * 3 + j] * moved[l]).sum::<f64>();
            }
            for l in 0..d {
                a.motion[i * d + l] = moved[l] + (0..f).map(|j| axes[l * 3 + j] * out[v + j]).sum::<f64>();
            }
        }
        s.articulated = a;
    }
}

/// One or zero, from a truth.
trait FromBool {
    fn from_f64_bool(b: bool) -> Self;
}
impl<S: partita_math::scalar::Scalar> FromBool for S {
    fn from_f64_bool(b: bool) -> Self {
        if b {
            S::one()
        } else {
            S::zero()
        }
    }
}
