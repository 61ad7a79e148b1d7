//! The limits of the renderer.

/// The most parts a foreground can have: a call's eight people and what lies around them.
pub const MOST_PARTS: usize = 9;

/// Widest and highest picture, pixels: a tile's column and row are 8 bits each.
pub const MOST_PIXELS: u32 = 4096;
