//! Why a question has no answer.

use partita_model::DescriptionError;
use partita_system::SystemError;
use thiserror::Error;

/// A question that could not be answered.
#[derive(Debug, Error)]
pub enum AnalysisError {
    /// The mechanism could not be compiled with all its closings in space.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// A question that makes no sense as asked.
    #[error("{message}")]
    Argument {
        /// What was given wrongly.
        argument: &'static str,
        /// What is wrong with it.
        message: String,
    },
    /// A name that the system does not have.
    #[error("{message}")]
    Unknown {
        /// The name.
        name: String,
        /// What there is.
        message: String,
    },
    /// It could not be evaluated at this position, for a reason that the whole mechanism tells.
    #[error("{error}; {cause}")]
    Explained {
        /// What failed.
        error: SystemError,
        /// What is behind it.
        cause: String,
    },
    /// It could not be evaluated at this position.
    #[error(transparent)]
    System(#[from] SystemError),
}
