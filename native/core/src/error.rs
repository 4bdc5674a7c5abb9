//! What can go wrong, each with one sentence for the user.

use std::fmt;

/// Why a computation gave no result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Error {
    /// An argument is unusable; the sentence says which and why.
    InvalidInput(String),
    /// The user gave up.
    Cancelled,
    /// The system did not give this many bytes.
    OutOfMemory(usize),
    /// Meniscus itself is wrong; what it said when it panicked.
    Defect(String),
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InvalidInput(sentence) => formatter.write_str(sentence),
            Self::Cancelled => formatter.write_str("The work was cancelled"),
            Self::OutOfMemory(bytes) => {
                let megabytes = (*bytes as f64 / 1e6).ceil();
                write!(formatter, "There is not enough memory: at least {megabytes} MB more were needed; use fewer balls")
            }
            Self::Defect(text) => write!(formatter, "Meniscus' native core has a defect, please report it: {text}"),
        }
    }
}

impl std::error::Error for Error {}

/// The result of a computation that can fail.
pub type Result<T> = std::result::Result<T, Error>;
