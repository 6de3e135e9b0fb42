//! The methods that a mechanism has for its equations: the recursion over clusters, explicit closing, compiled rates.

use crate::loop_closure::LoopClosing;
use crate::model::ModelScratch;
use crate::Model;
use partita_math::scalar::Recording;
use partita_system::choice::Choice;
use partita_system::closing::Closing;
use partita_system::compiled::CompiledRates;
use partita_system::system::{Clustered, Methods};
use partita_system::{SystemError, SystemRef};
use std::sync::Arc;

impl Methods for Model {
    fn clustered(&self) -> Option<&dyn Clustered<ModelScratch>> {
        Some(self)
    }
    fn closing<'s>(
        system: SystemRef<'s, Self>,
        t: f64,
        q: &[f64],
        inputs: Option<&[usize]>,
    ) -> Result<Box<dyn Closing + Send + 's>, SystemError>
    where
        Self: 's,
    {
        Ok(Box::new(LoopClosing::of(system, t, q, inputs)?))
    }
    fn recorded_rates(&self, choice: &Choice, most: usize) -> Option<Recording> {
        self.rates_of(choice, most)
    }
    fn compiled_rates(&self, choice: &Choice) -> Option<Arc<CompiledRates>> {
        self.compiled.of(choice)
    }
    fn given_number(&self, place: usize) -> f64 {
        self.own.callers.functions.given_number(place)
    }
    fn beside(system: &SystemRef<Self>, work: impl FnOnce(&Self) + Send + 'static) -> bool {
        let SystemRef::Shared(model) = system else { return false };
        let model = model.clone();
        std::thread::Builder::new().spawn(move || work(&model)).is_ok()
    }
}
