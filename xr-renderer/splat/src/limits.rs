//! The limits of the renderer.

/// The most parts a foreground can have: a call's eight people and what lies around them.
pub const MOST_PARTS: usize = 9;

/// Widest and highest picture, pixels: a tile's column and row are 8 bits each.
pub const MOST_PIXELS: u32 = 4096;

/// The most pairs of splat and tile that one part of a foreground makes in all views of a picture: 8,388,608, 32 MiB of lists. The demo person makes
/// 0.4 million in a picture of 1024x1024 that is filled; 250,000 splats of 5 by 5 tiles make 6 million.
pub const MOST_PART_PAIRS: u32 = 1 << 23;

/// The most that all parts make together: half of what the least device's largest buffer holds, so that the rest is the background's.
pub const MOST_FOREGROUND_PAIRS: u32 = 1 << 24;

/// The most invocations that share the sorted splats while tiles are listed: a GPU has thousands to feed.
pub const MOST_LISTING_LANES: u32 = 1024;

/// The largest table of what each of them has counted for each tile: where there are many tiles they are fewer.
pub const MOST_LISTING_BYTES: u64 = 64 << 20;
