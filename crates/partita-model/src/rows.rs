//! Rows of C: owner and name of each.

use crate::spec::{Coupling, Spec};
use partita_system::system::structure;
use std::sync::Arc;

/// Owner of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Owner {
    /// Joint number i: its loop closure, or a condition of its own.
    Joint(usize),
    /// Coupling number i.
    Coupling(usize),
    /// Rotor number i, on a joint that closes a loop.
    Rotor(usize),
    /// Drive number i.
    Drive(usize),
}

impl Owner {
    /// Itself, in words.
    pub fn words(self, spec: &Spec) -> String {
        match self {
            Self::Joint(j) => format!("joint \"{}\"", spec.joints[j].name),
            Self::Coupling(i) => format!("{} \"{}\"", spec.couplings[i].word(), spec.couplings[i].name()),
            Self::Rotor(i) => format!("rotor \"{}\"", spec.rotors[i].name),
            Self::Drive(i) => {
                let d = &spec.drives[i];
                match d.measure.of_joint() {
                    Some(joint) if d.name == format!("drive of {joint}") => format!("the {}", d.name),
                    Some(joint) => format!("drive \"{}\" of {joint}", d.name),
                    None => format!("drive \"{}\"", d.name),
                }
            }
        }
    }
    /// Its name.
    pub fn name(self, spec: &Spec) -> &str {
        match self {
            Self::Joint(j) => &spec.joints[j].name,
            Self::Coupling(i) => spec.couplings[i].name(),
            Self::Rotor(i) => &spec.rotors[i].name,
            Self::Drive(i) => &spec.drives[i].name,
        }
    }
}

/// A row as shown to the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// Its owner.
    pub owner: Owner,
    /// Its name.
    pub name: String,
}

impl Row {
    /// With its words, for a system: its closure error under a large displacement, and whether it constrains a direction.
    pub(crate) fn described(&self, spec: &Spec, displacement: Option<f64>, is_angle: bool) -> structure::Row {
        let owner: Arc<str> = self.owner.words(spec).into();
        let description = match (self.owner, self.name.rsplit_once('.')) {
            (Owner::Joint(_), Some((joint, what))) => format!("joint \"{joint}\" in {what}").into(),
            _ => owner.clone(),
        };
        let is_drive = matches!(self.owner, Owner::Drive(_));
        let is_function = |k: usize| matches!(spec.couplings[k], Coupling::Function { .. });
        let may_jump = is_drive || matches!(self.owner, Owner::Coupling(k) if is_function(k));
        let name = self.name.as_str().into();
        structure::Row { name, description, owner, displacement, is_angle, is_drive, may_jump }
    }
}
