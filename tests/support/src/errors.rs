//! Errors as a user reads them.

use std::error::Error;

/// An error and all its causes, in one line.
#[must_use]
pub fn whole_message(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        text = format!("{text}: {cause}");
        next = cause.source();
    }
    text
}
