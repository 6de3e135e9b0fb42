//! Errors of this interface.

use partita_analysis::AnalysisError;
use partita_model::DescriptionError;
use partita_system::SystemError;

/// Why the request failed: a sentence with the joint, body or loop, the numbers and a next step.
///
/// ```
/// use partita::{Error, Mechanism};
///
/// let e = Mechanism::new("nothing").compile().err().unwrap();
/// assert!(matches!(e, Error::Description(_)));
/// ```
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The description is not that of a mechanism.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// A position, a state or a run could not be computed.
    #[error(transparent)]
    Analysis(#[from] AnalysisError),
    /// A text is not a description.
    #[error("the description could not be read: {0}")]
    Json(#[from] serde_json::Error),
    /// A name that the mechanism does not have.
    #[error("there is no {kind} \"{name}\"; known: {known}")]
    Unknown {
        /// Joint or body.
        kind: &'static str,
        /// The name.
        name: String,
        /// The names that exist.
        known: String,
    },
}

impl From<SystemError> for Error {
    fn from(e: SystemError) -> Self {
        Self::Analysis(e.into())
    }
}
