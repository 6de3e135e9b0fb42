//! Articulated inertias: `M⁻¹` without M, in time proportional to the number of links.
//!
//! Inward, the inertia felt at each link with all joints beyond it free to move; outward, the compliance `Y` of each
//! link. `[M⁻¹]_ii = D_i⁻¹ + K_iᵀ Y_parent K_i` needs no column of M⁻¹. (Featherstone 2008; Kreutz-Delgado, Jain,
//! Rodriguez 1992.) Massless links have the small inertia that makes M a metric.

use crate::tree::{LinkMotion, Tree, TreeScratch, Weight};
use partita_math::dense;
use partita_math::scalar::{Real, Scalar};
use partita_math::spatial::{Space, Vec3};
use std::convert::Infallible;

/// `X` of a link: its twist is `X` times its parent's. Rows and columns: rotation first.
fn shift<G: Space>(arm: Vec3<G::S>, out: &mut [G::S]) {
    let (d, o) = (G::DIM, G::S::zero());
    out[..d * d].fill(o);
    for i in 0..d {
        out[i * d + i] = G::S::one();
    }
    let [x, y, z] = arm.0;
    if d == 6 {
        // u + w × r
        let m = [[o, z, -y], [-z, o, x], [y, -x, o]];
        for i in 0..3 {
            out[(3 + i) * 6..(3 + i) * 6 + 3].copy_from_slice(&m[i]);
        }
    } else {
        out[3] = -y;
        out[6] = x;
    }
}

/// Sum of `f(0) … f(n − 1)`.
#[inline(always)]
fn sum<S: Scalar>(n: usize, f: impl Fn(usize) -> S) -> S {
    let mut all = S::zero();
    for i in 0..n {
        all += f(i);
    }
    all
}

/// `out += Xᵀ M X` (`by_rows` false) or `out += X M Xᵀ` (true).
fn congruence<S: Scalar>(x: &[S], m: &[S], d: usize, by_rows: bool, out: &mut [S]) {
    let mut half = [S::zero(); 36];
    let at = |i: usize, j: usize| if by_rows { x[i * d + j] } else { x[j * d + i] };
    for i in 0..d {
        for j in 0..d {
            half[i * d + j] = sum(d, |l| at(i, l) * m[l * d + j]);
        }
    }
    for i in 0..d {
        for j in 0..d {
            out[i * d + j] += sum(d, |l| half[i * d + l] * at(j, l));
        }
    }
}

/// Factor a pivot: the inertia felt with all joints beyond free, relative to that with all of them locked.
fn felt<S: Real>(v: usize, pivot: &mut [S], f: usize) -> Result<(), (usize, f64)> {
    let largest = (0..f).fold(0.0, |m: f64, j| m.max(pivot[j * f + j].value()));
    if largest <= 0.0 || largest.is_nan() || dense::cholesky(pivot, f).is_err() {
        return Err((v, largest));
    }
    Ok(())
}

impl<G: Space> Tree<G> {
    fn dof(&self, i: usize) -> usize {
        if matches!(self.links[i].motion, LinkMotion::Ball) {
            3
        } else {
            1
        }
    }

    fn arm_from_parent(&self, i: usize, s: &TreeScratch<G>) -> Vec3<G::S> {
        let x = &s.links[i];
        G::vec_to(match self.links[i].motion {
            LinkMotion::Slide(_) => x.arm_in,
            _ => x.arm_in + x.arm_out,
        })
    }

    /// Inward sweep at the last poses and inertias. Fails with the velocity that moves no inertia and its pivot.
    pub fn articulate(&self, s: &mut TreeScratch<G>) -> Result<(), (usize, f64)>
    where
        G::S: Real,
    {
        self.sweep_inward(s, &self.massless, felt)
    }

    /// As `articulate`, with the given masses alone.
    pub fn articulate_as_drawn(&self, s: &mut TreeScratch<G>) -> Result<(), (usize, f64)>
    where
        G::S: Real,
    {
        self.sweep_inward(s, &[], felt)
    }

    /// [`articulate`](Self::articulate) without inspecting the pivots.
    pub fn articulate_straight(&self, s: &mut TreeScratch<G>) {
        let straight = |_, pivot: &mut [G::S], f| {
            dense::cholesky_straight(pivot, f);
            Ok::<(), Infallible>(())
        };
        match self.sweep_inward(s, &self.massless, straight) {
            Ok(()) => {}
            Err(never) => match never {},
        }
    }

    /// `factor(velocity, pivot, dof)` overwrites the pivot by its Cholesky factor.
    fn sweep_inward<E>(
        &self,
        s: &mut TreeScratch<G>,
        massless: &[Weight<G>],
        factor: impl Fn(usize, &mut [G::S], usize) -> Result<(), E>,
    ) -> Result<(), E> {
        let (n, d) = (self.links.len(), G::DIM);
        let mut a = std::mem::take(&mut s.articulated);
        let o = G::S::zero();
        a.inertia.clear();
        a.inertia.resize(n * d * d, o);
        a.axes.resize(n * d * 3, o);
        a.gain.resize(n * d * 3, o);
        a.inverse.resize(n * 9, o);
        for i in 0..n {
            G::add_inertia(&s.links[i].inertia, self.links[i].mass, &mut a.inertia[i * d * d..(i + 1) * d * d]);
        }
        for x in massless {
            let inertia = G::world_inertia(&s.links[x.link].rot, &x.inertia);
            G::add_inertia(&inertia, x.mass, &mut a.inertia[x.link * d * d..(x.link + 1) * d * d]);
        }
        let mut failed = None;
        for i in (1..n).rev() {
            let f = self.dof(i);
            let axes = &mut a.axes[i * d * 3..(i + 1) * d * 3];
            for j in 0..f {
                let v = self.links[i].v + j;
                let one = |w: usize| if w == v { G::S::one() } else { o };
                let (w, u) = self.propagate(i, s, G::Ang::default(), G::Vec::default(), one);
                let twist = G::components(w, u);
                for l in 0..d {
                    axes[l * 3 + j] = twist[l];
                }
            }
            let (before, rest) = a.inertia.split_at_mut(i * d * d);
            let own = &mut rest[..d * d];
            let mut u = [o; 18];
            for l in 0..d {
                for j in 0..f {
                    u[l * 3 + j] = sum(d, |m| own[l * d + m] * axes[m * 3 + j]);
                }
            }
            let mut pivot = [o; 9];
            for j in 0..f {
                for l in 0..f {
                    pivot[j * f + l] = sum(d, |m| axes[m * 3 + j] * u[m * 3 + l]);
                }
                if let Some(rotor) = self.rotor(self.links[i].v + j) {
                    pivot[j * f + j] += rotor;
                }
            }
            if let Err(e) = factor(self.links[i].v, &mut pivot[..f * f], f) {
                failed = Some(e);
                break;
            }
            let inverse = &mut a.inverse[i * 9..(i + 1) * 9];
            dense::inverse_from_cholesky(&pivot[..f * f], f, &mut inverse[..f * f]);
            let gain = &mut a.gain[i * d * 3..(i + 1) * d * 3];
            for l in 0..d {
                for j in 0..f {
                    gain[l * 3 + j] = sum(f, |m| u[l * 3 + m] * inverse[m * f + j]);
                }
            }
            for l in 0..d {
                for m in 0..d {
                    own[l * d + m] -= sum(f, |j| gain[l * 3 + j] * u[m * 3 + j]);
                }
            }
            let p = self.links[i].parent;
            if p > 0 {
                let mut x = [G::S::zero(); 36];
                shift::<G>(self.arm_from_parent(i, s), &mut x);
                congruence(&x, own, d, false, &mut before[p * d * d..(p + 1) * d * d]);
            }
        }
        s.articulated = a;
        failed.map_or(Ok(()), Err)
    }

    /// Diagonal of `M⁻¹` after [`articulate`](Self::articulate).
    pub fn inverse_mass_diagonal(&self, s: &mut TreeScratch<G>, out: &mut [G::S]) {
        let (n, d) = (self.links.len(), G::DIM);
        let mut a = std::mem::take(&mut s.articulated);
        a.compliance.resize(n * d * d, G::S::zero());
        a.compliance.fill(G::S::zero());
        for i in 1..n {
            let f = self.dof(i);
            let (p, v) = (self.links[i].parent, self.links[i].v);
            let mut x = [G::S::zero(); 36];
            shift::<G>(self.arm_from_parent(i, s), &mut x);
            let mut y = [G::S::zero(); 36]; // X Y_p Xᵀ
            congruence(&x, &a.compliance[p * d * d..(p + 1) * d * d], d, true, &mut y);
            let (axes, gain) = (&a.axes[i * d * 3..], &a.gain[i * d * 3..]);
            let inverse = &a.inverse[i * 9..];
            for j in 0..f {
                let shifted = sum(d, |l| gain[l * 3 + j] * sum(d, |m| y[l * d + m] * gain[m * 3 + j]));
                out[v + j] = inverse[j * f + j] + shifted;
            }
            // Y = (1 − S Kᵀ) X Y_p Xᵀ (1 − S Kᵀ)ᵀ + S D⁻¹ Sᵀ
            let mut through = [G::S::zero(); 36];
            for l in 0..d {
                for m in 0..d {
                    let unit = if l == m { G::S::one() } else { G::S::zero() };
                    through[l * d + m] = unit - sum(f, |j| axes[l * 3 + j] * gain[m * 3 + j]);
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

    /// `M⁻¹ f` for efforts f (nv), after [`articulate`](Self::articulate).
    pub fn inverse_mass_product(&self, effort: &[G::S], s: &mut TreeScratch<G>, out: &mut [G::S]) {
        let (n, d, o) = (self.links.len(), G::DIM, G::S::zero());
        let mut a = std::mem::take(&mut s.articulated);
        a.force.resize(n * d, o);
        a.motion.resize(n * d, o);
        a.left.resize(n, [o; 3]);
        a.force.fill(o);
        a.motion.fill(o);
        let mut x = [o; 36];
        for i in (1..n).rev() {
            let f = self.dof(i);
            let v = self.links[i].v;
            let (axes, gain) = (&a.axes[i * d * 3..], &a.gain[i * d * 3..]);
            for j in 0..f {
                let pushed = sum(d, |l| axes[l * 3 + j] * a.force[i * d + l]);
                a.left[i][j] = effort[v + j] - pushed;
            }
            let p = self.links[i].parent;
            if p > 0 {
                shift::<G>(self.arm_from_parent(i, s), &mut x);
                for m in 0..d {
                    let all = sum(d, |l| {
                        let own = a.force[i * d + l] + sum(f, |j| gain[l * 3 + j] * a.left[i][j]);
                        x[l * d + m] * own
                    });
                    a.force[p * d + m] += all;
                }
            }
        }
        for i in 1..n {
            let f = self.dof(i);
            let (p, v) = (self.links[i].parent, self.links[i].v);
            let (axes, gain, inverse) = (&a.axes[i * d * 3..], &a.gain[i * d * 3..], &a.inverse[i * 9..]);
            shift::<G>(self.arm_from_parent(i, s), &mut x);
            let mut moved = [o; 6];
            for l in 0..d {
                moved[l] = sum(d, |m| x[l * d + m] * a.motion[p * d + m]);
            }
            for j in 0..f {
                let own = sum(f, |h| inverse[j * f + h] * a.left[i][h]);
                out[v + j] = own - sum(d, |l| gain[l * 3 + j] * moved[l]);
            }
            for l in 0..d {
                a.motion[i * d + l] = moved[l] + sum(f, |j| axes[l * 3 + j] * out[v + j]);
            }
        }
        s.articulated = a;
    }
}
