//! A prescribed orientation: of B relative to A, as three rows, one for each component of an angular velocity in B's
//! axes.
//!
//! ```text
//!      a_i, b_i   axes of the joint as A and as B carry them        t_i = Σ_m Q_mi a_m   where b_i shall be
//!      E_ij = t_i · b_j                                             what is left to turn, by θ about n
//!      ρ = tan(θ/2) n,   ρ_k = (E_ji − E_ij) / (1 + tr E)           Gibbs vector, (i, j, k) cyclic
//!      Φ_k = 2 ρ_k       Φ_k' = g · w,  g = e_k + e_k × ρ + ρ_k ρ   w of B seen from t, in the axes of B
//! ```
//!
//! `Q(t)` may rotate by any number of turns: ρ is the remaining rotation, which vanishes in one position only and
//! increases up to the opposite one, so that assembly converges from any start.

use crate::measurement::{power_columns, Mover, Unit};
use crate::spec::Turning;
use crate::tree::{Tree, TreeScratch};
use crate::value::{self, Instant, Turned};
use partita_math::scalar::{Cases, Scalar};
use partita_math::spatial::Space;
use partita_math::tolerance;
use partita_system::SystemError;

/// One of the three rows.
#[derive(Clone, Debug)]
pub struct Orientation<G: Space> {
    /// Axes on A.
    pub on_a: [G::Ang; 3],
    /// As `on_a`, on B.
    pub on_b: [G::Ang; 3],
    /// Which component.
    pub component: usize,
    /// The prescribed orientation.
    pub turning: Turning,
    /// Links of A and B.
    pub links: [usize; 2],
    /// Nodes of A and B; 0 for a rotation of the tree.
    pub nodes: [usize; 2],
    /// Links between them that rotate.
    pub movers: Vec<Mover>,
}

/// One instant.
struct Now<G: Space> {
    /// Prescribed and actual axes of B.
    t: [G::Ang; 3],
    b: [G::Ang; 3],
    rho: [G::S; 3],
    /// Unit moment on B.
    moment: G::Ang,
}

/// Position level of the row: Φ and a, and the unit moment.
pub(super) struct Held<G: Space> {
    pub value: G::S,
    pub rate: G::S,
    pub unit: Unit<G>,
}

fn sum<G: Space>(x: [G::S; 3], axes: &[G::Ang; 3]) -> G::Ang {
    G::scale_ang(axes[0], x[0]) + G::scale_ang(axes[1], x[1]) + G::scale_ang(axes[2], x[2])
}

fn cross<S: Scalar>(a: [S; 3], b: [S; 3]) -> [S; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot<S: Scalar>(a: [S; 3], b: [S; 3]) -> S {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl<G: Space> Orientation<G> {
    fn target(&self, at: &Instant<G::S>, name: &str, memory: &mut Vec<f64>) -> Result<Turned<G::S>, SystemError> {
        value::turned_at(&self.turning, at.callers, at.t, name, memory)
    }

    /// `e_k`.
    fn unit_vector(&self) -> [G::S; 3] {
        std::array::from_fn(|i| if i == self.component { G::S::one() } else { G::S::zero() })
    }

    fn now(&self, to: &Turned<G::S>, s: &TreeScratch<G>) -> Now<G> {
        let (ra, rb) = (&s.links[self.links[0]].rot, &s.links[self.links[1]].rot);
        let a = self.on_a.map(|x| G::rotate_ang(ra, x));
        let b = self.on_b.map(|x| G::rotate_ang(rb, x));
        let t: [G::Ang; 3] = std::array::from_fn(|i| sum::<G>([0, 1, 2].map(|m| to.rotation[m][i]), &a));
        let e = |i: usize, j: usize| G::dot_ang(t[i], b[j]);
        let spread = G::S::one() + e(0, 0) + e(1, 1) + e(2, 2);
        let past = spread - G::S::from_f64(tolerance::EQUAL_IN_SIX_DIGITS.powi(2));
        let rho: [G::S; 3] = std::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            past.where_positive(
                (e(j, i) - e(i, j)).over_or_zero(spread),
                G::S::from_f64(1.0 / tolerance::EQUAL_IN_SIX_DIGITS),
            )
        });
        let k = self.component;
        let (u, turned) = (self.unit_vector(), cross(self.unit_vector(), rho));
        let moment = sum::<G>(std::array::from_fn(|i| u[i] + turned[i] + rho[k] * rho[i]), &b);
        Now { t, b, rho, moment }
    }

    fn unit(&self, moment: G::Ang, tree: &Tree<G>, s: &TreeScratch<G>) -> Unit<G> {
        let point = [s.links[self.links[1]].centre, s.links[self.links[0]].centre];
        Unit { moment, force: G::Vec::default(), point, in_world: tree.reference_point(self.links[1], s) }
    }

    /// Φ, a and the unit moment at the last poses.                                         (S3, S4)
    pub(super) fn position(
        &self,
        tree: &Tree<G>,
        s: &TreeScratch<G>,
        at: &Instant<G::S>,
        name: &str,
        memory: &mut Vec<f64>,
    ) -> Result<Held<G>, SystemError> {
        let to = self.target(at, name, memory)?;
        let x = self.now(&to, s);
        let two = x.rho[self.component].scale(2.0);
        let rate = -G::dot_ang(x.moment, sum::<G>(to.spin, &x.t));
        Ok(Held { value: two, rate, unit: self.unit(x.moment, tree, s) })
    }

    /// Its row of C.
    pub(super) fn columns(&self, unit: &Unit<G>, tree: &Tree<G>, s: &TreeScratch<G>, row: &mut [G::S]) {
        power_columns(&self.movers, unit, tree, s, row);
    }

    /// b at the last twists.                                                               (S5)
    pub(super) fn bias(
        &self,
        s: &TreeScratch<G>,
        at: &Instant<G::S>,
        name: &str,
        memory: &mut Vec<f64>,
    ) -> Result<G::S, SystemError> {
        let to = self.target(at, name, memory)?;
        let x = self.now(&to, s);
        let (xa, xb) = (&s.links[self.links[0]], &s.links[self.links[1]]);
        let spin = sum::<G>(to.spin, &x.t);
        let w = xb.w - xa.w - spin;
        // t rotates with A and changes by itself; only these two contributions remain
        let grown = xb.alpha - xa.alpha - G::cross_ang(xa.w, spin) - sum::<G>(to.growth, &x.t);
        let (rho, own) = (x.rho, x.b.map(|b| G::dot_ang(b, w)));
        let (over, along) = (cross(rho, own), dot(rho, own));
        let moved: [G::S; 3] = std::array::from_fn(|i| (own[i] + over[i] + rho[i] * along).scale(0.5));
        let (k, turned) = (self.component, cross(self.unit_vector(), moved));
        let g: [G::S; 3] = std::array::from_fn(|i| turned[i] + moved[k] * rho[i] + rho[k] * moved[i]);
        let bent = sum::<G>(g, &x.b) + G::cross_ang(xb.w, x.moment);
        Ok(G::dot_ang(x.moment, grown) + G::dot_ang(bent, w))
    }

    /// Whether it depends on time.
    pub fn is_rheonomic(&self) -> bool {
        !matches!(self.turning, Turning::Held(_))
    }

    /// Whether it calls a user function.
    pub fn calls(&self) -> bool {
        matches!(self.turning, Turning::Function(_))
    }

    /// Its unit moment on B at the last poses.
    pub(super) fn wrenches(
        &self,
        tree: &Tree<G>,
        s: &TreeScratch<G>,
        at: &Instant<G::S>,
        name: &str,
    ) -> Result<Unit<G>, SystemError> {
        let to = self.target(at, name, &mut Vec::new())?;
        Ok(self.unit(self.now(&to, s).moment, tree, s))
    }
}
