//! Methods of integration, by name.

use crate::explicit_rk::ExplicitRungeKutta;
use crate::implicit_rk::Radau;
use crate::options::{Options, OptionsError};
use crate::stepper::Stepper;
use crate::switching::Switching;
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
        let adapts = options.fixed_step.is_none();
        let explicit = ExplicitRungeKutta::new(self, dim, options.clone())?;
        match adapts {
            true => Ok(Box::new(Switching::advising(self.name, explicit, dim, &options))),
            false => Ok(Box::new(explicit)),
        }
    }
}

/// The method of Adams, Bashforth and Moulton, of orders two to ten with variable steps: two evaluations a step.
///
/// It predicts with the slopes of earlier steps, so it begins anew, at order two, wherever the coordinates or the forces
/// change: at a switch of independent coordinates, at a breakpoint, after a singular position. For smooth motions whose
/// evaluations are expensive; for all others a one-step method is cheaper.
#[derive(Debug)]
pub struct Adams;

/// The one of its kind.
pub static ADAMS: Adams = Adams;

impl Method for Adams {
    fn name(&self) -> &'static str {
        tableau::HEUN_EULER.name
    }

    fn stepper(&'static self, dim: usize, options: Options) -> Result<Box<dyn Stepper<SystemError>>, OptionsError> {
        Ok(Box::new(ExplicitRungeKutta::remembering(&tableau::HEUN_EULER, dim, options)?))
    }
}

/// Radau IIA of order five, for stiff forces.
#[derive(Debug)]
pub struct RadauIIA;

/// The one of its kind.
pub static RADAU: RadauIIA = RadauIIA;

impl Method for RadauIIA {
    fn name(&self) -> &'static str {
        Radau::NAME
    }

    fn stepper(&'static self, dim: usize, options: Options) -> Result<Box<dyn Stepper<SystemError>>, OptionsError> {
        Ok(Box::new(Radau::new(dim, options)?))
    }
}

/// DOP853, and Radau IIA where stiff forces limit its steps. Fixed steps are those of DOP853.
#[derive(Debug)]
pub struct Auto;

/// The one of its kind.
pub static AUTO: Auto = Auto;

impl Method for Auto {
    fn name(&self) -> &'static str {
        "auto"
    }

    fn stepper(&'static self, dim: usize, options: Options) -> Result<Box<dyn Stepper<SystemError>>, OptionsError> {
        let (table, adapts) = (&tableau::DOP853, options.fixed_step.is_none());
        let explicit = ExplicitRungeKutta::new(table, dim, options.clone())?;
        match adapts {
            true => Ok(Box::new(Switching::changing(table.name, explicit, dim, options)?)),
            false => Ok(Box::new(explicit)),
        }
    }
}

/// Every method, the recommended one first.
pub fn all() -> impl Iterator<Item = &'static dyn Method> {
    let tables = tableau::METHODS.into_iter().map(|tableau| tableau as &dyn Method);
    tables.chain([&ADAMS as &dyn Method, &RADAU as &dyn Method, &AUTO as &dyn Method])
}

/// The method called `name`, if there is one.
pub fn by_name(name: &str) -> Option<&'static dyn Method> {
    all().find(|method| method.name() == name)
}
