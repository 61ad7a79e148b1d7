//! One row of the standard table.

use super::measure::{Medians, Samples};
use mon3tr::size::Size;
use serde::Serialize;

/// A picture's size and its number of views.
pub(crate) type Format = (Size, u32);

/// One row of a table.
#[derive(Debug, Serialize)]
pub(crate) struct Row {
    pub(crate) gaussians: usize,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) views: u32,
    pub(crate) back_end: &'static str,
    /// (Gaussian, tile) pairs; 0 by quads.
    pub(crate) tile_pairs: u32,
    /// By the model in `traffic.rs`; only known of tiles.
    pub(crate) moved_bytes: Option<u64>,
    pub(crate) medians: Medians,
    pub(crate) samples: Samples,
}

impl Row {
    pub(crate) fn is_of(&self, (Size { width, height }, views): Format) -> bool {
        (self.width, self.height, self.views) == (width, height, views)
    }
}

/// "1024x1024", "2 x 1680x1760".
pub(crate) fn title(width: u32, height: u32, views: u32) -> String {
    let eyes = if views == 2 { "2 x " } else { "" };
    format!("{eyes}{width}x{height}")
}
