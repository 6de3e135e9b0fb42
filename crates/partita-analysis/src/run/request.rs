//! The options of a run as text, and their meaning.

use crate::error::AnalysisError;
use partita_integrate::method;
use partita_integrate::options::Options;
use partita_integrate::simulate::Settings;
use partita_math::tolerance;
use partita_system::compiled::Compilation;
use partita_system::options::{FormulationOptions, Renew, TangentMap};
use partita_system::partition::Selection;
use partita_system::record::Correction;
use partita_system::ConstrainedSystem;
use serde::Deserialize;
use std::collections::HashMap;
use std::sync::Arc;

/// Options of a run, as given by the user.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Start (s).
    #[serde(default)]
    pub t0: f64,
    /// End (s).
    pub t_end: f64,
    /// Relative tolerance.
    pub rtol: f64,
    /// Absolute tolerance.
    pub atol: f64,
    /// Method, by name.
    pub method: String,
    /// Formulation, by name.
    pub formulation: String,
    /// Fixed step (s).
    #[serde(default)]
    pub step: Option<f64>,
    /// Largest adaptive step (s).
    #[serde(default)]
    pub max_step: Option<f64>,
    /// Removal of the remainder of S3, by name.
    pub correction: String,
    /// Gain that a switch must exceed.
    pub switch_threshold: f64,
    /// Maximum number of accepted steps.
    pub max_steps: u64,
    /// Velocities to be kept independent, by name.
    #[serde(default)]
    pub independent: Option<Vec<String>>,
    /// Rule of choice, by name.
    pub selection: String,
    /// Preferences: velocity and factor.
    #[serde(default)]
    pub weights: Option<Vec<(String, f64)>>,
    /// Window of the rule "persistence" (s).
    #[serde(default)]
    pub window: Option<f64>,
    /// α and β of "baumgarte".
    #[serde(default)]
    pub baumgarte: Option<(f64, f64)>,
    /// When frozen tangent velocities are renewed.
    pub renew: Renewal,
    /// Whether evaluations are compiled: always, never, or where it is worth while.
    #[serde(default)]
    pub compiled: Option<bool>,
    /// Whether a thread of its own does that where it is worth while.
    #[serde(skip)]
    pub compiles_beside: bool,
    /// Memory for the steps, which states are read from later; 0: none is kept.
    #[serde(skip)]
    pub step_bytes: usize,
    /// Energy that was exchanged in segments before, if there are any: balances are relative to it.
    #[serde(skip)]
    pub exchanged_before: Option<f64>,
}

/// A part of the quality when frozen, or the words "each step".
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub enum Renewal {
    /// 0..1.
    Part(f64),
    /// "each step".
    Words(String),
}

fn refuse(argument: &'static str, message: String) -> AnalysisError {
    AnalysisError::Argument { argument, message }
}

/// Indices of named velocities.
fn indices<'n, S: ConstrainedSystem>(
    system: &S,
    names: impl Iterator<Item = &'n String>,
) -> Result<Vec<usize>, AnalysisError> {
    let known: Vec<&str> = system.structure().velocities.iter().map(|v| &*v.name).collect();
    let index: HashMap<&str, usize> = known.iter().enumerate().map(|(i, name)| (*name, i)).collect();
    names
        .map(|name| {
            index.get(name.as_str()).copied().ok_or_else(|| AnalysisError::Unknown {
                name: name.clone(),
                message: format!("there is no coordinate \"{name}\"; known: {}", known.join(", ")),
            })
        })
        .collect()
}

impl Request {
    /// A run from t0 to `t_end` with everything else as usual: projective, by DOP853, 1e-8 relative and 1e-10 absolute.
    pub fn over(t0: f64, t_end: f64) -> Self {
        Self {
            t0,
            t_end,
            rtol: tolerance::RTOL,
            atol: tolerance::ATOL,
            method: "dop853".into(),
            formulation: "projective".into(),
            step: None,
            max_step: None,
            correction: "partition".into(),
            switch_threshold: 1.25,
            max_steps: 10_000_000,
            independent: None,
            selection: "collective".into(),
            weights: None,
            window: None,
            baumgarte: None,
            renew: Renewal::Part(0.5),
            compiled: None,
            compiles_beside: false,
            step_bytes: 0,
            exchanged_before: None,
        }
    }

    /// Method, tolerances and end.
    ///
    /// # Errors
    /// `Argument` for an unknown method.
    pub(super) fn settings(&self) -> Result<Settings, AnalysisError> {
        let method = method::by_name(&self.method).ok_or_else(|| {
            let known: Vec<&str> = method::all().map(|m| m.name()).collect();
            refuse("method", format!("there is no method \"{}\"; choose among {}", self.method, known.join(", ")))
        })?;
        let options = Options {
            rtol: self.rtol,
            atol: self.atol.into(),
            controlled: usize::MAX,
            observed: None,
            max_step: self.max_step.unwrap_or(f64::INFINITY),
            fixed_step: self.step,
            first_step: None,
        };
        Ok(Settings { t_end: self.t_end, method, options, max_steps: self.max_steps })
    }

    /// Options of the formulation, with the user's tangent velocities.
    ///
    /// # Errors
    /// `Argument` for unknown words, `Unknown` for velocities that the system does not have.
    pub(super) fn formulation_options<S: ConstrainedSystem>(
        &self,
        system: &S,
        tangent: Option<Arc<dyn TangentMap>>,
    ) -> Result<FormulationOptions, AnalysisError> {
        let correction = match self.correction.as_str() {
            "partition" => Correction::Partition,
            "kantorovich" => Correction::Kantorovich,
            "mass-orthogonal" => Correction::MassOrthogonal,
            "none" => Correction::None,
            other => {
                let known = "partition, kantorovich, mass-orthogonal, none";
                return Err(refuse("correction", format!("there is no correction \"{other}\"; choose among {known}")));
            }
        };
        let selection = Selection::by_name(&self.selection).ok_or_else(|| {
            let known: Vec<&str> = Selection::ALL.iter().map(|s| s.name()).collect();
            let message = format!("there is no selection \"{}\"; choose among {}", self.selection, known.join(", "));
            refuse("selection", message)
        })?;
        let renew = match &self.renew {
            Renewal::Part(part) => Renew::Below(*part),
            Renewal::Words(words) if words == "each step" => Renew::EachStep,
            Renewal::Words(other) => {
                let message = format!("renew is \"{other}\"; give a number from 0 to 1, or \"each step\"");
                return Err(refuse("renew", message));
            }
        };
        let independent = self.independent.as_ref().map(|names| indices(system, names.iter())).transpose()?;
        let weights = match &self.weights {
            None => None,
            Some(pairs) => {
                let mut weights = vec![1.0; system.size().nv];
                for (i, (_, w)) in indices(system, pairs.iter().map(|p| &p.0))?.into_iter().zip(pairs) {
                    weights[i] = *w;
                }
                Some(weights)
            }
        };
        Ok(FormulationOptions {
            correction,
            switch_threshold: self.switch_threshold,
            independent,
            weights,
            selection,
            window: self.window,
            baumgarte: self.baumgarte,
            renew,
            tangent,
            compilation: match self.compiled {
                None if self.compiles_beside => Compilation::Beside,
                None => Compilation::Auto,
                Some(true) => Compilation::Always,
                Some(false) => Compilation::Never,
            },
        })
    }
}
