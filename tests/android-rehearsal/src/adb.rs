//! The protocol of `adb` and the driver, when the rehearsal is a device: one JSON value a line, one answer a question.

use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Names the driver's socket for its `adb`.
pub const SOCKET: &str = "REHEARSAL_DEVICE";

/// What was asked of `adb`.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Question {
    /// Its arguments.
    pub arguments: Vec<String>,
    /// The folder in which it was asked, which relative paths begin at.
    pub folder: PathBuf,
}

/// What it answers.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Answer {
    /// Its exit status.
    pub status: u8,
    /// What it prints: an error where the status is not 0.
    pub said: String,
}
