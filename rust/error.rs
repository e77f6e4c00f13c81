//! What a kernel can refuse, in the words of the person who asked.

use std::fmt;

/// A question a kernel cannot answer as asked. The text is one sentence: what, where, remedy.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Error {
    /// The input is malformed (shape, order, range): the caller can mend it.
    BadInput(String),
    /// The input is well formed but does not determine the answer.
    NotDetermined(String),
}

impl Error {
    /// A malformed question.
    #[must_use]
    pub fn bad_input(message: impl Into<String>) -> Self {
        Self::BadInput(message.into())
    }

    /// A well-formed question whose answer the data does not determine.
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
