//! The layouts of captures that are known, each recognised by its files. A reader gives what is in the folder, in this crate's conventions.

mod actors_hq;
mod data_set;
mod found;
mod opencv;
mod own;
mod smpl_params;
mod upright;

pub(crate) use found::Found;
pub use own::MOST_FRAMES;
pub(crate) use own::{MANIFEST, OWN_FRAMES, OWN_MASKS, OWN_MOTION, manifest};

use crate::error::CaptureError;
use std::path::Path;

/// Reads a folder, whatever its layout.
pub(crate) fn read(folder: &Path) -> Result<Found, CaptureError> {
    std::fs::read_dir(folder).map_err(|source| CaptureError::read(folder, source))?;
    let has = |name: &str| folder.join(name).exists();
    if has(MANIFEST) {
        return own::read(folder);
    }
    if has(opencv::AVATAR_REX) {
        return opencv::read_avatar_rex(folder);
    }
    if has(opencv::THUMAN) {
        return opencv::read_thuman(folder);
    }
    if folder
        .join(actors_hq::QUARTER)
        .join(actors_hq::CALIBRATION)
        .exists()
    {
        return actors_hq::read(folder);
    }
    if folder.join(OWN_FRAMES).is_dir() {
        return Err(CaptureError::Unfinished {
            folder: folder.to_owned(),
        });
    }
    Err(CaptureError::Layout {
        folder: folder.to_owned(),
        reason: format!(
            "it has no {MANIFEST} (our own layout), {} (AvatarReX), {} (THuman4.0) or {}/{} (ActorsHQ); videos are imported first: mon3tr-dev capture import",
            opencv::AVATAR_REX,
            opencv::THUMAN,
            actors_hq::QUARTER,
            actors_hq::CALIBRATION
        ),
    })
}
