//! The layouts of captures that are known, each recognised by its files. A reader gives what is in the folder, in this crate's conventions.

mod found;
mod own;

pub(crate) use found::Found;
pub use own::MOST_FRAMES;
pub(crate) use own::{MANIFEST, OWN_FRAMES, OWN_MASKS, OWN_MOTION, manifest};

use crate::error::CaptureError;
use std::path::Path;

/// Reads a folder, whatever its layout.
pub(crate) fn read(folder: &Path) -> Result<Found, CaptureError> {
    std::fs::read_dir(folder).map_err(|source| CaptureError::read(folder, source))?;
    if folder.join(MANIFEST).exists() {
        return own::read(folder);
    }
    if folder.join(OWN_FRAMES).is_dir() {
        return Err(CaptureError::Unfinished {
            folder: folder.to_owned(),
        });
    }
    Err(CaptureError::Layout {
        folder: folder.to_owned(),
        reason: format!("it has no {MANIFEST} (our own layout)"),
    })
}
