//! Errors of compiling a description.

use thiserror::Error;

/// A description that cannot be compiled: which element, and what to do about it.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("{element} \"{name}\": {message}")]
pub struct DescriptionError {
    /// body, joint, drive, force or mechanism.
    pub element: &'static str,
    /// Its name.
    pub name: String,
    /// The error and the next step.
    pub message: String,
}

impl DescriptionError {
    /// New error.
    pub fn new(element: &'static str, name: &str, message: impl Into<String>) -> Self {
        Self { element, name: name.into(), message: message.into() }
    }
}
