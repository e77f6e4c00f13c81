//! Errors of the kernels.

use std::fmt;

/// Why a kernel gives no result. The text is one sentence: what, where, remedy.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Error {
    /// The input is malformed (shape, order, range): the caller can correct it.
    BadInput(String),
    /// The input is well formed but does not determine the answer.
    NotDetermined(String),
}

impl Error {
    /// Error of a malformed input.
    #[must_use]
    pub fn bad_input(message: impl Into<String>) -> Self {
        Self::BadInput(message.into())
    }

    /// Error of a well-formed input that does not determine the answer.
    #[must_use]
    pub fn not_determined(message: impl Into<String>) -> Self {
        Self::NotDetermined(message.into())
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BadInput(message) | Self::NotDetermined(message) => f.write_str(message),
        }
    }
}

impl std::error::Error for Error {}

/// The result of every kernel.
pub type Result<T> = std::result::Result<T, Error>;
