//! Lengths |k_s| of efforts with all joints open, each body free (those fixed to each other as one): they depend on no
//! cut, no coordinates and no order, as those by the mass matrix of a tree would.
//!
//! ```text
//! effort ──► wrench on each body it acts on ──► |k_s|² = Σ f·f / m + (J⁻¹ M)·M ──► with the rotor on it
//! ```

use crate::evaluator::{Evaluator, Scratch};
use crate::massless::{lacking, Lacking};
use crate::rows::Owner;
use crate::spec::Spec;
use crate::spin::around;
use crate::wrench::{Free, Wrench};
use crate::zero_position::Placed;
use partita_math::dense::Matrix;
use partita_math::factor::symmetric_eigen;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Vec3};
use partita_system::SystemError;

/// Bodies fixed to each other.
#[derive(Clone, Debug)]
struct Whole {
    /// The link that carries it.
    link: usize,
    /// Centre of mass in the zero position.
    centre: Vec3<f64>,
    mass: f64,
    /// Inverse of the inertia about it, mechanism axes in the zero position.
    turns: Mat3<f64>,
    /// What of both is not its own.
    lacking: Option<Lacking>,
}

/// What an effort acts along.
#[derive(Clone, Copy, Debug)]
pub enum Along {
    /// A row of a drive.
    Row(usize),
    /// A velocity of the tree.
    Velocity(usize),
}

/// The bodies of a mechanism with all joints open.
#[derive(Clone, Debug)]
pub struct Freed {
    wholes: Vec<Whole>,
    /// The whole that each node belongs to; none for what is fixed to the ground.
    of: Vec<Option<usize>>,
    /// Inertia of the rotors on a joint's velocity.
    rotors: Vec<(usize, usize, f64)>,
}

/// The node that stands for all nodes fixed to each other.
fn fixed_together(placed: &Placed) -> Vec<usize> {
    let mut stands: Vec<usize> = (0..=placed.bodies.len()).collect();
    fn first(stands: &[usize], mut node: usize) -> usize {
        while stands[node] != node {
            node = stands[node];
        }
        node
    }
    for p in placed.joints.iter().filter(|p| p.shape.mobility() == 0) {
        let (one, two) = (first(&stands, p.parent), first(&stands, p.child));
        stands[one.max(two)] = one.min(two); // the ground is the first
    }
    (0..stands.len()).map(|node| first(&stands, node)).collect()
}

/// The inverse of a symmetric matrix, zero along axes about which nothing turns.
fn inverse(inertia: &Mat3<f64>) -> Mat3<f64> {
    let mut found = Mat3::zero();
    let Ok((moments, axes)) = symmetric_eigen(&Matrix::from_vec(3, 3, inertia.0.as_flattened().to_vec())) else {
        return found; // not finite: refused elsewhere
    };
    for (k, moment) in moments.iter().enumerate().filter(|x| *x.1 > 0.0) {
        let axis: [f64; 3] = std::array::from_fn(|i| axes[(i, k)]);
        found = found.add(&Mat3(axis.map(|a| axis.map(|b| a * b / moment))));
    }
    found
}

impl Freed {
    /// With the present masses of a placed description.
    pub(crate) fn new(spec: &Spec, placed: &Placed) -> Self {
        let stands = fixed_together(placed);
        let around = around(placed);
        let mut of = vec![None; stands.len()];
        let mut wholes = Vec::new();
        for &node in stands.iter().filter(|&&node| node > 0) {
            if of[node].is_some() {
                continue;
            }
            let on: Vec<usize> = (0..placed.bodies.len()).filter(|i| stands[i + 1] == node).collect();
            on.iter().for_each(|i| of[i + 1] = Some(wholes.len()));
            let mut mass: f64 = on.iter().map(|&i| placed.bodies[i].mass).sum();
            let weight = |i: usize| if mass > 0.0 { placed.bodies[i].mass / mass } else { 1.0 / on.len() as f64 };
            let centre = on.iter().fold(Vec3::zero(), |c, &i| c + placed.bodies[i].com.times(weight(i)));
            let mut inertia = on.iter().fold(Mat3::zero(), |all, &i| {
                let b = &placed.bodies[i];
                all.add(&b.inertia).add(&Mat3::steiner(b.mass, b.com - centre))
            });
            let lacking = lacking(placed, &around, &on, centre);
            if let Some(Lacking { mass: more, inertia: turning }) = lacking {
                (mass, inertia) = (mass + more, inertia.add(&turning));
            }
            let turns = inverse(&inertia);
            wholes.push(Whole { link: placed.bodies[on[0]].link, centre, mass, turns, lacking });
        }
        let rotor = |r: &crate::spec::Rotor| {
            let joint = placed.joint_numbers.get(&r.joint)?;
            Some((*joint, r.coordinate, r.inertia * r.ratio * r.ratio))
        };
        let rotors = spec.rotors.iter().filter_map(rotor).collect();
        Self { wholes, of, rotors }
    }

    /// |k_s|² of an effort at (t, q), at the last look: of components along `what`, with their factors.    (I2)
    ///
    /// # Errors
    /// Functions that fail.
    pub fn length2<S: Scalar>(
        &self,
        e: &Evaluator<S>,
        (t, q): (S, &[S]),
        s: &Scratch<S>,
        what: impl Iterator<Item = (Along, S)>,
    ) -> Result<S, SystemError> {
        let mut on = vec![None; self.wholes.len()];
        let mut rotor = S::zero();
        for (along, factor) in what {
            let mut put = |[a, b]: [usize; 2], w: Wrench<S>, point: Vec3<S>| {
                let w = Wrench { moment: w.moment.times(factor), force: w.force.times(factor) };
                for (node, w) in [(a, w.opposite()), (b, w)] {
                    let Some(whole) = self.of[node] else { continue };
                    on[whole].get_or_insert_with(Wrench::default).add(&w.about(point - self.centre(e, s, whole)));
                }
            };
            let joint = match along {
                Along::Row(row) => match e.drives.iter().find(|d| d.row == row) {
                    Some(d) if d.joint.is_none() => {
                        let owner = Owner::Drive(d.number);
                        if let Some(c) = e.full.conditions.iter().find(|c| c.owner == owner) {
                            e.apply_condition(&s.full, (t, q), (c.row, S::one()), &mut put, |_, _| ())?;
                        }
                        None
                    }
                    found => found.and_then(|d| d.joint),
                },
                Along::Velocity(v) => match e.joint_moved_by(v) {
                    Some(joint) => Some(joint),
                    None => {
                        e.load_along(v, s, &mut put);
                        None
                    }
                },
            };
            if let Some((j, which)) = joint {
                let mut axes = Vec::new();
                e.free_axes(j, s, &mut axes);
                let wanted = |i: usize| if i == which { S::one() } else { S::zero() };
                let p = &e.placed.joints[j];
                put(
                    [p.parent, p.child],
                    Free::new(&axes).with_along(&Wrench::default(), wanted),
                    e.joint_point_now(s, j),
                );
                let turning = self.rotors.iter().filter(|r| (r.0, r.1) == (j, which));
                rotor += turning.fold(S::zero(), |sum, r| sum + S::from_f64(r.2));
            }
        }
        let mut sum = S::zero();
        for (whole, w) in self.wholes.iter().zip(&on) {
            let Some(w) = w else { continue };
            let own = s.full.links[whole.link].rot.apply_transposed(w.moment);
            if whole.mass > 0.0 {
                sum += w.force.dot(w.force).scale(1.0 / whole.mass);
            }
            sum += own.dot(Mat3::<S>::from_f64(whole.turns.0).apply(own));
        }
        Ok(sum / (S::one() + rotor * sum))
    }

    /// Add to a mass matrix of motions with these velocities at q, what bodies lack in a metric: the
    /// same as in their lengths.
    pub fn add_lacking(
        &self,
        e: &Evaluator<f64>,
        q: &[f64],
        motions: &[Vec<f64>],
        s: &mut Scratch<f64>,
        mass: &mut [f64],
    ) {
        let lacking: Vec<(usize, &Lacking)> =
            self.wholes.iter().enumerate().filter_map(|(i, w)| Some((i, w.lacking.as_ref()?))).collect();
        if lacking.is_empty() {
            return;
        }
        let twist = |v: &Vec<f64>| {
            e.look(q, v, s);
            let of = |&(i, _): &(usize, &Lacking)| {
                let link = self.wholes[i].link;
                let (x, arm) = (&s.full.links[link], self.centre(e, s, i) - e.full.reference_point(link, &s.full));
                (x.u + x.w.cross(arm), x.rot.apply_transposed(x.w))
            };
            lacking.iter().map(of).collect::<Vec<_>>()
        };
        let twists: Vec<Vec<(Vec3<f64>, Vec3<f64>)>> = motions.iter().map(twist).collect();
        for (i, one) in twists.iter().enumerate() {
            for (j, two) in twists.iter().enumerate() {
                let terms = one.iter().zip(two).zip(&lacking);
                mass[i * twists.len() + j] += terms
                    .map(|(((u, w), (u2, w2)), (_, x))| x.mass * u.dot(*u2) + w.dot(x.inertia.apply(*w2)))
                    .sum::<f64>();
            }
        }
    }

    /// Centre of mass of a whole, in the world of the tree.
    fn centre<S: Scalar>(&self, e: &Evaluator<S>, s: &Scratch<S>, whole: usize) -> Vec3<S> {
        let w = &self.wholes[whole];
        e.full.reference_point(w.link, &s.full) + e.arm_now(s, w.link, Vec3::from_f64(w.centre.0))
    }
}
