//! Methods of integration, by name.

use crate::explicit_rk::ExplicitRungeKutta;
use crate::options::{Options, OptionsError};
use crate::stepper::Stepper;
use crate::tableau::{self, Tableau};
use partita_system::SystemError;
use std::fmt::Debug;

/// A method of integration: it makes the steppers that integrate a mechanism by it.
pub trait Method: Debug + Sync {
    /// Name used in options, results and messages.
    fn name(&self) -> &'static str;
    /// A stepper for an equation of dimension `dim`.
    ///
    /// # Errors
    /// Options that contradict themselves or the method.
    fn stepper(&'static self, dim: usize, options: Options) -> Result<Box<dyn Stepper<SystemError>>, OptionsError>;
}

impl Method for Tableau {
    fn name(&self) -> &'static str {
        self.name
    }

    fn stepper(&'static self, dim: usize, options: Options) -> Result<Box<dyn Stepper<SystemError>>, OptionsError> {
        Ok(Box::new(ExplicitRungeKutta::new(self, dim, options)?))
    }
}

/// Every method, the recommended one first.
pub fn all() -> impl Iterator<Item = &'static dyn Method> {
    tableau::METHODS.into_iter().map(|tableau| tableau as &dyn Method)
}

/// The method called `name`, if there is one.
pub fn by_name(name: &str) -> Option<&'static dyn Method> {
    all().find(|method| method.name() == name)
}
