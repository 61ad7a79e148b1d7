// Included by the build script too, which defines each for the shaders.

/// A splat contributes nothing to a pixel where its opacity is less. 3DGS's value, a step of an 8-bit picture: with a lower one splats
/// reach farther.
pub const ALPHA_CUT: f32 = 1.0 / 255.0;

/// Room for rounding where it is tested whether a splat reaches a block or a tile, as log2 of alpha: no pixel that would have kept it is left out.
pub const TEST_SLACK: f32 = 1e-3;

/// Splats whose rectangle has as many tiles are listed only on those that their outline passes.
pub const CLOSE_LOOK: u32 = 12;

/// Side of a screen tile in pixels; `TILE` in shaders.
pub const TILE_PIXELS: u32 = 16;

/// The most rows of tiles that a picture has: one of 4096 pixels.
pub const MOST_TILE_ROWS: usize = 256;

/// Elements one workgroup of the prefix sum takes: some for each of its 256 invocations.
pub const SCAN_BLOCK: u32 = 1024;
const _: () = assert!(
    SCAN_BLOCK.is_multiple_of(256),
    "each invocation has as many"
);

/// The depth sort ranks the items of a bin one by one, each against all others, up to so many; a bin with more is crowded and goes through
/// [`SORT_CROWDED`](crate::SORT_CROWDED).
pub const CROWDED: u32 = 64;

/// Items of a crowded bin for each of its parts, at least, on average.
pub const ITEMS_PER_PART: u32 = 4;
