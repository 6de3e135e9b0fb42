//! Conditions other than joints: couplings (gear, rack, distance, cam, rolling, user-defined), drives, and the
//! conditions that joints have besides their locks.
//!
//! ```text
//! C rows:  closings of joints │ couplings  │ drives     │ couplings of rates │ drives of rates
//!                             │  as positions (S3, S4)  │   as rates alone (S4: nonholonomic)
//! ```
//!
//! A condition is a law over readings ([`crate::measurement`]), which supply gradient and bias; the law adds its own
//! derivatives. Rolling has a geometry of its own.

mod build;
mod law;
mod order;
mod orientation;
mod rolling;

pub(crate) use build::all;
pub use law::{Law, Prescribed};
pub use order::{order, wraps, ConditionRows};
pub use orientation::Orientation;
pub use rolling::{Contact, Rolling};

use crate::measurement::{power_columns, Measurement, Mover, Quantity, Unit};
use crate::rows::{Owner, Row};
use crate::spec::Spec;
use crate::tree::{Tree, TreeScratch};
use crate::value::{Functions, Instant};
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;
use partita_system::SystemError;

/// Nodes of the bodies moved by velocities of the tree.
const IN_TREE: [usize; 2] = [0, 0];

/// Kind of a condition.
#[derive(Clone, Debug)]
pub enum Says<G: Space> {
    /// A law over readings.
    Law(Law<G::S>, Vec<Measurement<G>>),
    /// A disc or a ball touches a plane, or rolls on it.
    Rolling(Rolling<G>, Contact),
    /// A component of a prescribed orientation.
    Turning(Box<Orientation<G>>),
}

/// One condition: one row of C, or two.
#[derive(Clone, Debug)]
pub struct Condition<G: Space> {
    /// Name, for messages.
    pub name: String,
    /// Its owner.
    pub owner: Owner,
    /// First row.
    pub row: usize,
    /// First entry among the values of C.
    pub entry: usize,
    /// Velocities of every row, ascending.
    pub columns: Vec<usize>,
    /// Whether it constrains positions. Else rates alone.
    pub holonomic: bool,
    /// Its kind.
    pub says: Says<G>,
}

/// Two links loaded by a condition: a wrench on B and its opposite on A.
pub struct Pushed<G: Space> {
    /// Nodes of A and B.
    pub nodes: [usize; 2],
    /// Wrench on B, for a multiplier 1.
    pub unit: Unit<G>,
}

impl<G: Space> Condition<G> {
    /// Rows of C.
    pub fn rows(&self) -> usize {
        match &self.says {
            Says::Law(..) | Says::Turning(_) => 1,
            Says::Rolling(_, contact) => contact.rows(),
        }
    }

    /// Φ, C and a at the last poses.                                                       (S3, S4)
    pub(crate) fn position(
        &self,
        tree: &Tree<G>,
        s: &TreeScratch<G>,
        at: &Instant<G::S>,
        memory: &mut Vec<f64>,
        phi: &mut [G::S],
        c: &mut [G::S],
        a: &mut [G::S],
    ) -> Result<(), SystemError> {
        let width = self.columns.len();
        let rows = &mut c[self.entry..self.entry + self.rows() * width];
        rows.fill(G::S::zero());
        match &self.says {
            Says::Law(law, readings) => {
                let found = law.position(tree, s, at, readings, &self.name, memory)?;
                for (reading, factor) in readings.iter().zip(found.gradient()) {
                    reading.columns(*factor, tree, s, rows);
                }
                if self.holonomic {
                    phi[self.row] = found.value;
                }
                a[self.row] = found.rate;
            }
            Says::Rolling(rolling, contact) => {
                rolling.columns(*contact, tree, s, width, rows);
                if self.holonomic {
                    phi[self.row] = rolling.height(tree, s);
                }
            }
            Says::Turning(orientation) => {
                let found = orientation.position(tree, s, at, &self.name, memory)?;
                orientation.columns(&found.unit, tree, s, rows);
                (phi[self.row], a[self.row]) = (found.value, found.rate);
            }
        }
        Ok(())
    }

    /// b at the last twists.                                                               (S5)
    pub(crate) fn velocity(
        &self,
        tree: &Tree<G>,
        s: &TreeScratch<G>,
        at: &Instant<G::S>,
        memory: &mut Vec<f64>,
        b: &mut [G::S],
    ) -> Result<(), SystemError> {
        match &self.says {
            Says::Law(law, readings) => {
                b[self.row] = law.velocity(tree, s, at, readings, &self.name, memory)?;
            }
            Says::Rolling(rolling, contact) => rolling.bias(*contact, tree, s, &mut b[self.row..]),
            Says::Turning(orientation) => b[self.row] = orientation.bias(s, at, &self.name, memory)?,
        }
        Ok(())
    }

    /// Effect of the multipliers of its own rows: `put(multiplier, wrench)` for each pair of loaded bodies,
    /// `along(velocity, effort)` for coordinates of the tree.
    pub(crate) fn apply(
        &self,
        tree: &Tree<G>,
        s: &TreeScratch<G>,
        at: &Instant<G::S>,
        lambda: &[G::S],
        mut put: impl FnMut(G::S, &Pushed<G>),
        mut along: impl FnMut(usize, G::S),
    ) -> Result<(), SystemError> {
        match &self.says {
            Says::Law(law, readings) => {
                let found = law.position(tree, s, at, readings, &self.name, &mut Vec::new())?;
                for (reading, factor) in readings.iter().zip(found.gradient()) {
                    let effort = lambda[0] * *factor;
                    match (reading.unit(tree, s), &reading.quantity) {
                        (Some(unit), Quantity::Spin(_)) if reading.nodes == IN_TREE => {
                            self.apply_along(&reading.movers, &unit, effort, tree, s, &mut along);
                        }
                        (Some(unit), _) => put(effort, &Pushed { nodes: reading.nodes, unit }),
                        (None, Quantity::Coordinate { v, .. }) => along(*v, effort),
                        (None, _) => {}
                    }
                }
            }
            Says::Rolling(rolling, contact) => {
                for (i, unit) in rolling.units(*contact, tree, s).iter().enumerate().take(contact.rows()) {
                    put(lambda[i], &Pushed { nodes: rolling.nodes, unit: *unit });
                }
            }
            Says::Turning(x) => {
                let unit = x.wrenches(tree, s, at, &self.name)?;
                match x.nodes == IN_TREE {
                    true => self.apply_along(&x.movers, &unit, lambda[0], tree, s, &mut along),
                    false => put(lambda[0], &Pushed { nodes: x.nodes, unit }),
                }
            }
        }
        Ok(())
    }

    /// A moment in a spatial rotation of the tree, as efforts along its velocities.
    fn apply_along(
        &self,
        movers: &[Mover],
        unit: &Unit<G>,
        effort: G::S,
        tree: &Tree<G>,
        s: &TreeScratch<G>,
        along: &mut impl FnMut(usize, G::S),
    ) {
        let mut row = [G::S::zero(); 3];
        power_columns(movers, unit, tree, s, &mut row);
        self.columns.iter().zip(row).for_each(|(&v, x)| along(v, effort * x));
    }

    /// Names of its rows.
    pub fn named(&self, spec: &Spec) -> Vec<Row> {
        let row = |name: String| Row { owner: self.owner, name };
        let name = self.owner.name(spec);
        match (self.owner, &self.says) {
            (Owner::Drive(_), _) if name.starts_with("drive ") => vec![row(name.to_string())],
            (Owner::Drive(_), _) => vec![row(format!("drive {name}"))],
            (_, Says::Rolling(_, Contact::Touches)) => vec![row(format!("{name}.touch"))],
            (_, Says::Rolling(_, Contact::Rolls)) => [1, 2].map(|i| row(format!("{name}.roll{i}"))).into(),
            (Owner::Joint(j), Says::Law(Law::Function(k), _)) => {
                let follower = spec.joints[j].followers.iter().find(|f| f.function == *k);
                vec![row(format!("{name}.{}", follower.map_or("", |f| f.direction.as_str())))]
            }
            (Owner::Joint(_), Says::Law(_, readings)) if readings.len() == 2 => vec![row(format!("{name}.advance"))],
            (Owner::Joint(_), _) => vec![row(format!("{name}.twist"))],
            (Owner::Rotor(_), _) => vec![row(format!("rotor {name}"))],
            (Owner::Coupling(i), _) => vec![row(format!("{} {name}", spec.couplings[i].word()))],
        }
    }

    /// Whether it depends explicitly on time.
    pub fn is_rheonomic(&self) -> bool {
        match &self.says {
            Says::Law(law, _) => law.is_rheonomic(),
            Says::Turning(orientation) => orientation.is_rheonomic(),
            Says::Rolling(..) => false,
        }
    }

    /// Whether it calls one of these functions.
    pub fn calls(&self, functions: &dyn Functions) -> bool {
        match &self.says {
            Says::Law(law, _) => law.calls(functions),
            Says::Turning(orientation) => orientation.calls(),
            Says::Rolling(..) => false,
        }
    }

    /// Pairs of nodes that it loads.
    pub(crate) fn nodes(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        let own = match &self.says {
            Says::Rolling(rolling, _) => Some(rolling.nodes),
            Says::Turning(orientation) => Some(orientation.nodes),
            Says::Law(..) => None,
        };
        self.readings().iter().map(|r| r.nodes).chain(own)
    }

    /// Links on which it depends.
    pub(crate) fn links(&self) -> Vec<usize> {
        match &self.says {
            Says::Rolling(rolling, _) => rolling.links.to_vec(),
            Says::Turning(orientation) => orientation.links.to_vec(),
            Says::Law(_, readings) => readings.iter().flat_map(|r| r.links).collect(),
        }
    }

    /// Its readings.
    pub fn readings(&self) -> &[Measurement<G>] {
        match &self.says {
            Says::Law(_, readings) => readings,
            Says::Rolling(..) | Says::Turning(_) => &[],
        }
    }
}
