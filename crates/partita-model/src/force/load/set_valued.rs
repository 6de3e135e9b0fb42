//! Laws with more than one force at a state: dry friction that sticks, rigid stops, freewheels, latches.
//!
//! Where one acts as a constraint, its force is the multiplier of a row, and its law has none. While friction slips, its
//! law is the force against the motion. Of a state alone none of them knows how it acts: what needs forces asks
//! [`Model::set_valued`](crate::model::Model::set_valued) before.

use super::{EffortArguments, Response, ScalarLaw};
use crate::numbers::Fields;
use crate::spec;
use crate::value::{Instant, Source};
use partita_math::scalar::Scalar;
use partita_system::SystemError;

/// What a run decides about.
#[derive(Clone, Debug)]
pub struct SetValued<S> {
    /// Magnitude of friction while it slips, and while it sticks, if it differs; none: no friction.
    levels: Vec<Source<S>>,
    /// The signs of the motion that friction resists by the force of each; 0: it has none.
    signs: [S; 2],
}

impl<S: Scalar> SetValued<S> {
    pub(super) fn friction(x: &spec::Friction, n: &Fields<S>) -> Self {
        let mut levels = vec![Source::new(&x.dynamic, n.field("dynamic").first())];
        levels.extend(x.held.as_ref().map(|v| Source::new(v, n.field("static").first())));
        Self { levels, signs: x.signs.map(S::from_f64) }
    }

    pub(super) fn constraint() -> Self {
        Self { levels: Vec::new(), signs: [S::zero(); 2] }
    }

    /// Magnitudes of friction while it slips and while it sticks; none of another law.
    pub(crate) fn levels(
        &self,
        at: &Instant<S>,
        name: &str,
        plain: &mut Vec<f64>,
    ) -> Result<Option<[S; 2]>, SystemError> {
        let Some(slips) = self.levels.first() else { return Ok(None) };
        let slips = slips.at(at, name, plain)?;
        let sticks = self.levels.get(1).map_or(Ok(slips), |sticks| sticks.at(at, name, plain))?;
        // values may change: at rest it carries no less than in motion
        Ok(Some([slips, sticks.max(slips)]))
    }
}

impl<S: Scalar> ScalarLaw<S> for SetValued<S> {
    fn respond(&self, asked: &EffortArguments<S>, plain: &mut Vec<f64>) -> Result<Response<S>, SystemError> {
        let none = Response { effort: S::zero(), potential: S::zero(), power: S::zero() };
        let Some([slips, sticks]) = self.levels(asked.instant, asked.name, plain)? else { return Ok(none) };
        let effort = -(slips * self.signs[0] + sticks * self.signs[1]);
        Ok(Response { effort, power: effort * asked.rate, ..none })
    }
    fn depends_on_value(&self) -> bool {
        false
    }
    fn sources(&self) -> &[Source<S>] {
        &self.levels
    }
}
