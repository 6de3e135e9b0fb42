//! Effort along a joint coordinate by a curve over what is read off the mechanism: gas force over crank angle.

use super::reading::KNOWN;
use super::{At, Effect, Reading};
use crate::measurement;
use crate::spec::Table;
use crate::value;
use partita_math::scalar::Scalar;
use partita_math::spatial::Space;
use partita_system::SystemError;

/// An effort that is a curve over a reading.
#[derive(Clone, Debug)]
pub struct EffortOver<G: Space> {
    /// Name, for messages.
    pub name: String,
    /// The coordinate it acts along.
    pub along: Reading<G>,
    /// What it depends on.
    pub over: measurement::Measurement<G>,
    /// The curve.
    pub curve: Table,
    /// Does it repeat itself after its last break?
    pub periodic: bool,
    /// Are whole turns of what it depends on not known, and do they matter?
    pub turns: bool,
}

impl<G: Space> EffortOver<G> {
    #[inline(always)]
    pub(crate) fn wrench(&self, at: &At<G>) -> Result<Effect<G>, SystemError> {
        let read = self.along.read(at);
        let x = self.over.value(at.tree, at.s, at.instant.q);
        if let (true, Some(by)) = (self.turns, x.outside(-KNOWN, KNOWN)) {
            return Err(SystemError::Wound { what: self.name.clone(), by });
        }
        let [effort, _, _] = value::curve_at(&self.curve, self.periodic, x, &self.name)?;
        let power = effort * read.rate;
        Ok(Effect { application: self.along.application(&read, effort), potential: G::S::default(), power })
    }
}
