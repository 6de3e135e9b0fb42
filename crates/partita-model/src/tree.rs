//! The compiled mechanism in one space: links, closings, applied forces. Written once for planes and for space.
//!
//! Every link's axes are the world's when all coordinates are zero, and its reference point is its centre of mass (or
//! its joint's point if it has no mass). Then a joint is a motion about an axis that parent and child share, and
//! composing poses needs no constant rotations.
//!
//! Positions are kept relative to the joint that attaches a branch to the ground: in a chain a kilometre long the loops
//! still close to the round-off of their own size.

use partita_math::scalar::Scalar;
use partita_math::spatial::Space;

/// One elementary motion of a link relative to its parent.
#[derive(Clone, Copy, Debug)]
pub enum LinkMotion<G: Space> {
    /// Rotation about an axis.
    Turn(G::Ang),
    /// Translation along an axis.
    Slide(G::Vec),
    /// All turns.
    Ball,
}

/// A link: one elementary motion and the bodies that it moves.
#[derive(Clone, Copy, Debug)]
pub struct Link<G: Space> {
    /// Link it moves on; 0 is the ground.
    pub parent: usize,
    /// Its motion.
    pub motion: LinkMotion<G>,
    /// First coordinate.
    pub q: usize,
    /// First velocity.
    pub v: usize,
    /// From the parent's reference point to the joint's point, parent axes.
    pub to_joint: G::Vec,
    /// From the joint's point to the reference point, own axes.
    pub to_centre: G::Vec,
    /// Mass; zero for links that carry no body.
    pub mass: G::S,
    /// Inertia about the reference point, own axes.
    pub inertia: G::Inertia,
}

/// Additional mass and inertia of a link where a metric is needed, not in any equation of motion.
#[derive(Clone, Copy, Debug)]
pub struct Weight<G: Space> {
    /// Link.
    pub link: usize,
    /// Mass.
    pub mass: G::S,
    /// Inertia about the reference point, own axes.
    pub inertia: G::Inertia,
}

/// A point on a link, own axes, from the reference point.
#[derive(Clone, Copy, Debug)]
pub struct Anchor<G: Space> {
    /// Link.
    pub link: usize,
    /// Offset.
    pub at: G::Vec,
}

/// Displacements that a loop closure locks.
#[derive(Clone, Debug)]
pub enum Locked<G: Space> {
    /// All displacements, in world axes.
    World,
    /// Along axes fixed on A.
    Along(Vec<G::Vec>),
}

/// A link on the path between the two sides of a closing.
#[derive(Clone, Copy, Debug)]
pub struct PathLink {
    /// Link.
    pub link: usize,
    /// Whether it is on the side of B (the child).
    pub on_b: bool,
    /// Index of its first velocity among the columns of the displacement rows.
    pub slide_column: usize,
    /// Index among the columns of the rotation rows (meaningless for translations).
    pub turn_column: usize,
}

/// A cut joint: what it locks between A (parent) and B (child).                            (S3)
#[derive(Clone, Debug)]
pub struct Closing<G: Space> {
    /// Index of the joint in the description.
    pub joint: usize,
    /// Side of the parent.
    pub a: Anchor<G>,
    /// Side of the child.
    pub b: Anchor<G>,
    /// From the origin of A's branch to that of B's.
    pub offset: G::Vec,
    /// Locked displacements.
    pub slides: Locked<G>,
    /// Locked turns.
    pub locks: Vec<G::Lock>,
    /// First row.
    pub row: usize,
    /// First entry in the values of C.
    pub entry: usize,
    /// Links between the two sides, in the order of their velocities.
    pub path: Vec<PathLink>,
    /// Columns of a displacement row.
    pub slide_columns: usize,
    /// Columns of a rotation row.
    pub turn_columns: usize,
}

impl<G: Space> Closing<G> {
    /// Displacement rows.
    pub fn slide_rows(&self) -> usize {
        match &self.slides {
            Locked::World => G::LENGTHS,
            Locked::Along(axes) => axes.len(),
        }
    }
    /// The last link of both sides, after all that they stand on.
    pub(crate) fn last_link(&self) -> usize {
        self.a.link.max(self.b.link)
    }
    /// All rows.
    pub fn rows(&self) -> usize {
        self.slide_rows() + self.locks.len()
    }
    /// Entries in C.
    pub fn entries(&self) -> usize {
        self.slide_rows() * self.slide_columns + self.locks.len() * self.turn_columns
    }
}

/// The compiled mechanism in the space G.
#[derive(Clone, Debug)]
pub struct Tree<G: Space> {
    /// Links, parents first; link 0 is the ground.
    pub links: Vec<Link<G>>,
    /// Mass and inertia that links lack in a metric; nothing where M is one.
    pub massless: Vec<Weight<G>>,
    /// Inertia of the rotors that each velocity moves; nothing where there are none.
    pub rotors: Vec<Option<G::S>>,
    /// Closings.
    pub closings: Vec<Closing<G>>,
    /// Gravity.
    pub gravity: G::Vec,
    /// Links without mass, inertia or applied force.
    pub idle: Vec<bool>,
    /// Velocities along which an applied effort acts.
    pub efforts: Vec<usize>,
    /// Origin of the branch of each link: the point where it is attached to the ground.
    pub origins: Vec<G::Vec>,
    /// Coordinates.
    pub nq: usize,
    /// Velocities.
    pub nv: usize,
    /// Closing rows (without drives).
    pub rows: usize,
    /// Entries of C in the loop closures.
    pub entries: usize,
}

/// A link at one instant. Vectors in world axes.
#[derive(Clone, Copy, Debug)]
pub struct LinkState<G: Space> {
    /// Orientation.
    pub rot: G::Rot,
    /// Reference point, from the origin of its branch.
    pub centre: G::Vec,
    /// Joint's point, from the origin of its branch.
    pub joint: G::Vec,
    /// From the parent's reference point to the joint's point (rotations) or to the own one (translations).
    pub arm_in: G::Vec,
    /// From the joint's point to the reference point.
    pub arm_out: G::Vec,
    /// Axis of a rotation.
    pub axis: G::Ang,
    /// Axis of a translation.
    pub direction: G::Vec,
    /// Inertia about the reference point.
    pub inertia: G::Inertia,
    /// Angular velocity.
    pub w: G::Ang,
    /// Velocity of the reference point.
    pub u: G::Vec,
    /// Angular acceleration for v' = 0.
    pub alpha: G::Ang,
    /// Acceleration of the reference point for v' = 0.
    pub acc: G::Vec,
    /// Applied moment about the reference point.
    pub moment: G::Ang,
    /// Applied force.
    pub force: G::Vec,
}

impl<G: Space> LinkState<G> {
    fn rest() -> Self {
        Self {
            rot: G::identity(),
            centre: G::Vec::default(),
            joint: G::Vec::default(),
            arm_in: G::Vec::default(),
            arm_out: G::Vec::default(),
            axis: G::Ang::default(),
            direction: G::Vec::default(),
            inertia: G::Inertia::default(),
            w: G::Ang::default(),
            u: G::Vec::default(),
            alpha: G::Ang::default(),
            acc: G::Vec::default(),
            moment: G::Ang::default(),
            force: G::Vec::default(),
        }
    }
}

/// Memory of one evaluation.
#[derive(Clone, Debug)]
pub struct TreeScratch<G: Space> {
    /// Links.
    pub links: Vec<LinkState<G>>,
    /// Effort along each velocity.
    pub effort: Vec<G::S>,
    /// Partial twists, links x columns.
    pub partial: Vec<(G::Ang, G::Vec)>,
    /// Links that one coordinate moves.
    pub moves: Vec<bool>,
    /// Memory for the articulated recursion.
    pub articulated: crate::memory::Articulated<G::S>,
    /// Memory for the recursion over clusters.
    pub clusters: crate::memory::ClusterScratch<G::S>,
}

impl<G: Space> TreeScratch<G> {
    /// Of no links.
    pub(crate) fn empty() -> Self {
        Self {
            links: Vec::new(),
            effort: Vec::new(),
            partial: Vec::new(),
            moves: Vec::new(),
            articulated: crate::memory::Articulated::default(),
            clusters: crate::memory::ClusterScratch::default(),
        }
    }
}

/// `acc + α × r` for the angular acceleration α that `v' = 0` leaves.
#[inline(always)]
pub(crate) fn swung<G: Space>(acc: G::Vec, alpha: G::Ang, r: G::Vec) -> G::Vec {
    match G::GYROSCOPIC {
        true => acc + G::cross(alpha, r),
        false => acc,
    }
}

impl<G: Space> Tree<G> {
    /// Inertia of the rotors that velocity `v` moves.
    #[inline(always)]
    pub(crate) fn rotor(&self, v: usize) -> Option<G::S> {
        self.rotors.get(v).copied().flatten()
    }

    /// The velocities that move rotors, and their inertias.
    pub(crate) fn rotating(&self) -> impl Iterator<Item = (usize, G::S)> + '_ {
        self.rotors.iter().enumerate().filter_map(|(v, x)| x.map(|x| (v, x)))
    }

    /// New scratch.
    pub fn scratch(&self) -> TreeScratch<G> {
        let mut new = TreeScratch::empty();
        self.fit(&mut new);
        new
    }

    /// Allocate the memory, where a scratch has none yet.
    pub(crate) fn fit(&self, s: &mut TreeScratch<G>) {
        s.links.resize_with(self.links.len(), LinkState::rest);
        s.effort.resize(self.nv, G::S::zero());
        s.moves.resize(self.links.len(), false);
    }

    /// Poses of all links at q.
    pub fn poses(&self, q: &[G::S], s: &mut TreeScratch<G>) {
        for i in 1..self.links.len() {
            self.pose(i, q, s);
        }
    }

    /// Pose of link i at q, those of the links before it known.
    #[inline(always)]
    pub fn pose(&self, i: usize, q: &[G::S], s: &mut TreeScratch<G>) {
        let link = &self.links[i];
        let (rot_p, centre_p) = (s.links[link.parent].rot, s.links[link.parent].centre);
        let x = &mut s.links[i];
        match link.motion {
            LinkMotion::Turn(axis) => {
                x.arm_in = G::rotate(&rot_p, link.to_joint);
                x.axis = G::rotate_ang(&rot_p, axis);
                x.rot = G::turn(&rot_p, axis, q[link.q]);
                x.joint = centre_p + x.arm_in;
                x.arm_out = G::rotate(&x.rot, link.to_centre);
                x.centre = x.joint + x.arm_out;
            }
            LinkMotion::Slide(axis) => {
                x.direction = G::rotate(&rot_p, axis);
                x.rot = rot_p;
                let along = G::scale(x.direction, q[link.q]);
                x.arm_in = G::rotate(&rot_p, link.to_joint + link.to_centre) + along;
                x.centre = centre_p + x.arm_in;
                x.arm_out = G::rotate(&rot_p, link.to_centre);
                x.joint = x.centre - x.arm_out;
            }
            LinkMotion::Ball => {
                x.arm_in = G::rotate(&rot_p, link.to_joint);
                let p = [q[link.q], q[link.q + 1], q[link.q + 2], q[link.q + 3]];
                x.rot = G::turn_quaternion(&rot_p, p);
                x.joint = centre_p + x.arm_in;
                x.arm_out = G::rotate(&x.rot, link.to_centre);
                x.centre = x.joint + x.arm_out;
            }
        }
    }

    /// Reference point of a link in the world.
    #[inline]
    pub fn reference_point(&self, i: usize, s: &TreeScratch<G>) -> G::Vec {
        self.origins[i] + s.links[i].centre
    }

    /// Inertias in world axes at the last poses.
    pub fn inertias(&self, s: &mut TreeScratch<G>) {
        for (link, x) in self.links[1..].iter().zip(&mut s.links[1..]) {
            x.inertia = G::world_inertia(&x.rot, &link.inertia);
        }
    }

    /// Point of an anchor relative to the link's reference point, world axes.
    #[inline(always)]
    pub fn arm(&self, anchor: &Anchor<G>, s: &TreeScratch<G>) -> G::Vec {
        G::rotate(&s.links[anchor.link].rot, anchor.at)
    }

    /// Position of an anchor, from the origin of its branch. Measured from the joint that carries its link: an anchor
    /// at that joint is there to the last digit. An arm of rounding errors would rotate a small body by every force
    /// through it.
    #[inline(always)]
    pub fn spot(&self, anchor: &Anchor<G>, s: &TreeScratch<G>) -> G::Vec {
        let x = &s.links[anchor.link];
        x.joint + (x.arm_out + self.arm(anchor, s))
    }

    /// Twists and bias accelerations (v' = 0) of all links at v.
    pub fn twists(&self, v: &[G::S], s: &mut TreeScratch<G>) {
        for i in 1..self.links.len() {
            self.twist(i, v, s);
        }
    }

    /// Twist and bias acceleration of link i at v, those of the links before it known.
    #[inline(always)]
    pub fn twist(&self, i: usize, v: &[G::S], s: &mut TreeScratch<G>) {
        let link = &self.links[i];
        let p = &s.links[link.parent];
        let (w_p, u_p, alpha_p, acc_p) = (p.w, p.u, p.alpha, p.acc);
        let x = &mut s.links[i];
        match link.motion {
            LinkMotion::Slide(_) => {
                let slide = G::scale(x.direction, v[link.v]);
                let transport = G::cross(w_p, x.arm_in);
                x.w = w_p;
                x.u = u_p + transport + slide;
                x.alpha = alpha_p;
                let coriolis = G::cross(w_p, slide);
                x.acc = swung::<G>(acc_p, alpha_p, x.arm_in) + G::cross(w_p, transport) + coriolis + coriolis;
            }
            LinkMotion::Turn(_) | LinkMotion::Ball => {
                let turn = match link.motion {
                    LinkMotion::Turn(_) => G::scale_ang(x.axis, v[link.v]),
                    _ => {
                        G::scale_ang(G::body_axis(&x.rot, 0), v[link.v])
                            + G::scale_ang(G::body_axis(&x.rot, 1), v[link.v + 1])
                            + G::scale_ang(G::body_axis(&x.rot, 2), v[link.v + 2])
                    }
                };
                x.w = w_p + turn;
                x.alpha = alpha_p + G::cross_ang(w_p, turn);
                let (inner, outer) = (G::cross(w_p, x.arm_in), G::cross(x.w, x.arm_out));
                x.u = u_p + inner + outer;
                let at_joint = swung::<G>(acc_p, alpha_p, x.arm_in) + G::cross(w_p, inner);
                x.acc = swung::<G>(at_joint, x.alpha, x.arm_out) + G::cross(x.w, outer);
            }
        }
    }

    /// Twist of link i for the rates `rate(j)` of its own velocities on top of its parent's twist `(w, u)`.
    #[inline(always)]
    pub fn propagate(
        &self,
        i: usize,
        s: &TreeScratch<G>,
        w: G::Ang,
        u: G::Vec,
        rate: impl Fn(usize) -> G::S,
    ) -> (G::Ang, G::Vec) {
        let mut mine = [Default::default()];
        self.propagate_columns(i, s, &[(w, u)], &mut mine, |_, v| rate(v));
        mine[0]
    }

    /// As [`propagate`](Self::propagate), for several twists of the parent; `rate(column, j)`.
    #[inline(always)]
    pub fn propagate_columns(
        &self,
        i: usize,
        s: &TreeScratch<G>,
        parent: &[(G::Ang, G::Vec)],
        mine: &mut [(G::Ang, G::Vec)],
        rate: impl Fn(usize, usize) -> G::S,
    ) {
        let (link, x) = (&self.links[i], &s.links[i]);
        let turned = |(w, u): (G::Ang, G::Vec), turn: G::Ang| {
            let w2 = w + turn;
            (w2, u + G::cross(w, x.arm_in) + G::cross(w2, x.arm_out))
        };
        let columns = parent.iter().zip(mine).enumerate();
        match link.motion {
            LinkMotion::Turn(_) => {
                for (j, (p, mine)) in columns {
                    *mine = turned(*p, G::scale_ang(x.axis, rate(j, link.v)));
                }
            }
            LinkMotion::Slide(_) => {
                for (j, (&(w, u), mine)) in columns {
                    *mine = (w, u + G::cross(w, x.arm_in) + G::scale(x.direction, rate(j, link.v)));
                }
            }
            LinkMotion::Ball => {
                for (j, (p, mine)) in columns {
                    let turn = G::scale_ang(G::body_axis(&x.rot, 0), rate(j, link.v))
                        + G::scale_ang(G::body_axis(&x.rot, 1), rate(j, link.v + 1))
                        + G::scale_ang(G::body_axis(&x.rot, 2), rate(j, link.v + 2));
                    *mine = turned(*p, turn);
                }
            }
        }
    }

    /// Component of a wrench (moment about link i's reference point, force) along its own velocities.
    #[inline(always)]
    pub fn along(&self, i: usize, s: &TreeScratch<G>, moment: G::Ang, force: G::Vec, mut put: impl FnMut(usize, G::S)) {
        let (link, x) = (&self.links[i], &s.links[i]);
        let about_joint = || moment + G::moment(x.arm_out, force);
        match link.motion {
            LinkMotion::Turn(_) => put(link.v, G::dot_ang(x.axis, about_joint())),
            LinkMotion::Slide(_) => put(link.v, G::dot(x.direction, force)),
            LinkMotion::Ball => {
                let m = about_joint();
                for j in 0..3 {
                    put(link.v + j, G::dot_ang(G::body_axis(&x.rot, j), m));
                }
            }
        }
    }

    /// The same wrench about the parent's reference point.
    #[inline(always)]
    pub fn to_parent(&self, i: usize, s: &TreeScratch<G>, moment: G::Ang, force: G::Vec) -> G::Ang {
        let x = &s.links[i];
        let arm = match self.links[i].motion {
            LinkMotion::Slide(_) => x.arm_in,
            _ => x.arm_in + x.arm_out,
        };
        moment + G::moment(arm, force)
    }
}
