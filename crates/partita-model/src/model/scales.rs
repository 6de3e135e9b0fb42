//! Characteristic displacements of the velocities, and scales of the rows.

use crate::coupling::{Condition, Says};
use crate::joint::Motion;
use crate::measurement;
use crate::mechanics::Mechanics;
use crate::rows::Owner;
use crate::spec::{Coupling, Measure, Spec};
use crate::tree::{LinkMotion, Tree};
use crate::zero_position::Placed;
use partita_math::spatial::Space;
use partita_system::system::structure::{Coordinate, Velocity};

/// Least characteristic displacement of a closing row. Unit: size of the mechanism. Reason: its round-off is one of
/// positions, which are as large as the mechanism, and must be small against
/// [`CLOSED`](partita_math::tolerance::CLOSED) of a loop whose joints lie next to each other.
const LEAST_DISPLACEMENT: f64 = 1e-3;

/// Coordinates and velocities of the links: which belong to each other, and their sizes.
pub(super) struct Links {
    pub(super) coordinates: Vec<Coordinate>,
    pub(super) velocities: Vec<Velocity>,
    /// Characteristic displacements of the coordinates.
    pub(super) q_displacement: Vec<f64>,
}

impl Links {
    pub(super) fn new(placed: &Placed) -> Self {
        let velocity = |name: &String| Velocity { name: name.as_str().into(), coordinates: 0..0, displacement: 1.0 };
        let mut new = Self {
            coordinates: vec![Coordinate { velocity: None, turns: false, repeats: false }; placed.nq],
            velocities: placed.velocity_names.iter().map(velocity).collect(),
            q_displacement: vec![1.0; placed.nq],
        };
        for l in placed.links.iter().skip(1) {
            if matches!(l.motion, Motion::Ball) {
                new.velocities[l.v..l.v + 3].iter_mut().for_each(|v| v.coordinates = l.q..l.q + 4);
                continue;
            }
            new.velocities[l.v].coordinates = l.q..l.q + 1;
            new.coordinates[l.q].velocity = Some(l.v);
            match l.motion {
                Motion::Slide(_) => {
                    new.velocities[l.v].displacement = placed.length;
                    new.q_displacement[l.q] = placed.length;
                }
                _ => new.coordinates[l.q].turns = true,
            }
        }
        new
    }
}

/// Scales of rows, from large displacements.
pub(super) struct RowMeasures<'a> {
    pub(super) spec: &'a Spec,
    pub(super) placed: &'a Placed,
}

impl RowMeasures<'_> {
    /// Scale of a reading: a length, or 1 for angles and cosines.
    fn characteristic_displacement(&self, m: &Measure) -> f64 {
        match measurement::is_angle(self.placed, m) || matches!(m, Measure::Cosine { .. }) {
            true => 1.0,
            false => self.placed.length,
        }
    }

    /// Largest closure error of each row under a large displacement; unknown for user functions.
    pub(super) fn displacements<G: Space>(&self, tree: &Mechanics<G>) -> Vec<Option<f64>> {
        let mut displacements: Vec<Option<f64>> =
            closing_displacements(tree, self.placed).into_iter().map(Some).collect();
        let is_angle = |c: &Condition<G>| c.readings().first().is_some_and(|x| x.is_angle(tree));
        for c in &tree.conditions {
            let of = match (c.owner, &c.says) {
                (_, Says::Rolling(..)) => Some(self.placed.length),
                (Owner::Joint(_) | Owner::Rotor(_), _) => Some(if is_angle(c) { 1.0 } else { self.placed.length }),
                (Owner::Drive(i), _) => Some(self.characteristic_displacement(&self.spec.drives[i].measure)),
                (Owner::Coupling(i), _) => match &self.spec.couplings[i] {
                    Coupling::Linear { terms, factors, .. } => Some(
                        terms
                            .iter()
                            .zip(factors)
                            .fold(0.0, |m: f64, (t, f)| m.max(f.abs() * self.characteristic_displacement(t))),
                    ),
                    Coupling::Curve { terms, .. } => Some(self.characteristic_displacement(&terms[0])),
                    Coupling::Function { terms, like, .. } => {
                        like.and_then(|i| terms.get(i)).map(|m| self.characteristic_displacement(m))
                    }
                    Coupling::Roll { .. } => None,
                },
            };
            displacements.extend(vec![of; c.rows()]);
        }
        displacements
    }

    /// Flags of the rows that close directions.
    pub(super) fn angles<G: Space>(&self, tree: &Mechanics<G>) -> Vec<bool> {
        let mut angles = closing_angles(tree);
        let angle = |m: &Measure| measurement::is_angle(self.placed, m);
        for c in &tree.conditions {
            let of = match (c.owner, &c.says) {
                (_, Says::Rolling(..)) => false,
                (Owner::Joint(_) | Owner::Rotor(_), _) => c.readings().first().is_some_and(|x| x.is_angle(tree)),
                (Owner::Drive(i), _) => angle(&self.spec.drives[i].measure),
                (Owner::Coupling(i), _) => match &self.spec.couplings[i] {
                    Coupling::Curve { terms, .. } | Coupling::Function { terms, like: Some(0), .. } => angle(&terms[0]),
                    other => other.terms().iter().all(angle),
                },
            };
            angles.extend(vec![of; c.rows()]);
        }
        angles
    }
}

/// Largest closure error of each closing row under a large displacement: 1 for rotations; for displacements the longest
/// lever arm between the closing point and the joints of its loop, or the characteristic length where there is a
/// translation.
fn closing_displacements<G: Space>(tree: &Tree<G>, placed: &Placed) -> Vec<f64> {
    let mut displacements = Vec::with_capacity(tree.rows);
    for k in &tree.closings {
        let p = &placed.joints[k.joint];
        let mut length = LEAST_DISPLACEMENT * placed.size;
        for path in &k.path {
            let point = if path.on_b { p.child_point } else { p.parent_point };
            length = match tree.links[path.link].motion {
                LinkMotion::Slide(_) => placed.length,
                _ => length.max((point - placed.links[path.link].point).norm()),
            }
            .max(length);
        }
        displacements.extend((0..k.rows()).map(|i| if i < k.slide_rows() { length } else { 1.0 }));
    }
    displacements
}

/// Flags of the closing rows of rotations.
fn closing_angles<G: Space>(tree: &Tree<G>) -> Vec<bool> {
    tree.closings.iter().flat_map(|k| (0..k.rows()).map(|i| i >= k.slide_rows())).collect()
}
