//! Errors of an analysis.

use partita_model::DescriptionError;
use partita_system::SystemError;
use thiserror::Error;

/// An analysis that failed.
#[derive(Debug, Error)]
pub enum AnalysisError {
    /// The mechanism could not be compiled with all its closings in space.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// An invalid request.
    #[error("{message}")]
    Argument {
        /// The argument.
        argument: &'static str,
        /// Its error.
        message: String,
    },
    /// A name that the system does not have.
    #[error("{message}")]
    Unknown {
        /// The name.
        name: String,
        /// The names that exist.
        message: String,
    },
    /// The evaluation failed at this position; the reason is a property of the whole mechanism.
    #[error("{error}; {cause}")]
    Explained {
        /// What failed.
        error: SystemError,
        /// The underlying error.
        cause: String,
    },
    /// The caller no longer wanted the result.
    #[error("stopped by the caller")]
    Stopped,
    /// It could not be evaluated at this position.
    #[error(transparent)]
    System(#[from] SystemError),
}
