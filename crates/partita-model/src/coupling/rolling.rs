//! A disc or a ball on a plane.
//!
//! ```text
//!      a  axis of the disc (body B)          n  normal of the plane (body A), towards the centre p
//!      e = (n − a (a·n)) / s, s = |..|       from the point of contact to the centre; of a ball e = n
//!      c = p − R e                           the point of contact
//!      touching   (p − p₀)·n − R s = 0       its rate is n · V, V the velocity of B's point at c seen from A's
//!      rolling    t₁ · V = t₂ · V = 0        conditions on rates alone
//! ```

use crate::measurement::{power_columns, Ends, Mover, Unit};
use crate::tree::{Tree, TreeScratch};
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;

/// Which of the conditions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contact {
    /// It touches.
    Touches,
    /// It does not slip.
    Rolls,
}

impl Contact {
    /// Rows of C.
    pub fn rows(self) -> usize {
        match self {
            Self::Touches => 1,
            Self::Rolls => 2,
        }
    }
}

/// A disc or a ball (on B) and a plane (on A).
#[derive(Clone, Debug)]
pub struct Rolling<G: Space> {
    /// A point of the plane, and the centre.
    pub ends: Ends<G>,
    /// Axis of the disc on B; none for a ball.
    pub axis: Option<G::Vec>,
    /// Normal of the plane and two directions in it, on A.
    pub frame: [G::Vec; 3],
    /// Radius.
    pub radius: G::S,
    /// Links of A and B.
    pub links: [usize; 2],
    /// Nodes of A and B.
    pub nodes: [usize; 2],
    /// Links between them.
    pub movers: Vec<Mover>,
}

/// The contact at one instant.
struct Now<G: Space> {
    n: G::Vec,
    a: G::Vec,
    /// `a · n`, 0 for a ball.
    lean: G::S,
    e: G::Vec,
    s: G::S,
    /// From the plane's point to the centre.
    gap: G::Vec,
    /// The contact, from the origin of B's branch and from that of A's.
    point: [G::Vec; 2],
}

impl<G: Space> Rolling<G> {
    #[inline(always)]
    fn now(&self, tree: &Tree<G>, s: &TreeScratch<G>) -> Now<G> {
        let (ra, rb) = (&s.links[self.links[0]].rot, &s.links[self.links[1]].rot);
        let (_, centre, gap) = self.ends.now(tree, s);
        let n = G::rotate(ra, self.frame[0]);
        let (a, lean, e, sine) = match self.axis {
            Some(axis) => {
                let a = G::rotate(rb, axis);
                let lean = G::dot(a, n);
                let m = n - G::scale(a, lean);
                let sine = G::dot(m, m).sqrt();
                (a, lean, G::scale(m, G::S::one() / sine), sine)
            }
            None => (G::Vec::default(), G::S::zero(), n, G::S::one()),
        };
        let contact = centre - G::scale(e, self.radius);
        Now { n, a, lean, e, s: sine, gap, point: [contact, contact + self.ends.offset] }
    }

    /// Height of the disc above the plane.
    pub fn height(&self, tree: &Tree<G>, s: &TreeScratch<G>) -> G::S {
        let x = self.now(tree, s);
        G::dot(x.gap, x.n) - self.radius * x.s
    }

    /// Present directions of the rows.
    fn directions(&self, contact: Contact, s: &TreeScratch<G>) -> [G::Vec; 2] {
        let ra = &s.links[self.links[0]].rot;
        match contact {
            Contact::Touches => [G::rotate(ra, self.frame[0]), G::Vec::default()],
            Contact::Rolls => [G::rotate(ra, self.frame[1]), G::rotate(ra, self.frame[2])],
        }
    }

    /// Unit forces of the rows on B at the contact.
    pub fn units(&self, contact: Contact, tree: &Tree<G>, s: &TreeScratch<G>) -> [Unit<G>; 2] {
        let x = self.now(tree, s);
        let in_world = self.ends.origin_b + x.point[0];
        self.directions(contact, s).map(|force| Unit { moment: G::Ang::default(), force, point: x.point, in_world })
    }

    /// Its rows of C.
    pub fn columns(&self, contact: Contact, tree: &Tree<G>, s: &TreeScratch<G>, width: usize, rows: &mut [G::S]) {
        let units = self.units(contact, tree, s);
        // between parts of one rigid body nothing moves it
        for (row, unit) in rows.chunks_mut(width.max(1)).zip(&units) {
            power_columns(&self.movers, unit, tree, s, row);
        }
    }

    /// b of its rows at the last twists.
    pub fn bias(&self, contact: Contact, tree: &Tree<G>, s: &TreeScratch<G>, b: &mut [G::S]) {
        let x = self.now(tree, s);
        let (xa, xb) = (&s.links[self.links[0]], &s.links[self.links[1]]);
        let (arm_a, arm_b) = (x.point[1] - xa.centre, x.point[0] - xb.centre);
        let (ua, ub) = (xa.u + G::cross(xa.w, arm_a), xb.u + G::cross(xb.w, arm_b));
        // rates of the direction to the contact and of the contact point
        let n1 = G::cross(xa.w, x.n);
        let e1 = match self.axis {
            Some(_) => {
                let a1 = G::cross(xb.w, x.a);
                let m1 = n1 - G::scale(a1, x.lean) - G::scale(x.a, G::dot(a1, x.n) + G::dot(x.a, n1));
                G::scale(m1 - G::scale(x.e, G::dot(x.e, m1)), G::S::one() / x.s)
            }
            None => n1,
        };
        let to_centre = tree.arm(&self.ends.b, s);
        let moved = xb.u + G::cross(xb.w, to_centre) - G::scale(e1, self.radius);
        // the origin of a branch is at rest: the contact moves alike relative to both sides
        let acc_a = xa.acc + G::cross(xa.alpha, arm_a) + G::cross(xa.w, moved - xa.u);
        let acc_b = xb.acc + G::cross(xb.alpha, arm_b) + G::cross(xb.w, moved - xb.u);
        for (b, d) in b.iter_mut().zip(self.directions(contact, s)).take(contact.rows()) {
            *b = G::dot(d, acc_b - acc_a) + G::dot(G::cross(xa.w, d), ub - ua);
        }
    }
}
