//! Shader sources compiled to SPIR-V at build time, and the structs they share with Rust.
//!
//! The GLSL lies in `shaders/`; `build.rs` compiles it with glslang. This crate starts no device and
//! knows no Vulkan handle: `renderer-splat` and `renderer-openxr` make pipelines of what is here.

#![forbid(unsafe_code)]

use std::mem::offset_of;

mod eye;
mod frame;
mod gaussian;
mod gaussian_lanes;
mod shared;

pub use eye::{EyeParams, EyeView};
pub use frame::{FrameParams, PartParams, SortState, Splat, ViewParams, VisibleRows};
pub use gaussian::{
    Gaussian, LOG2_MOST_SCALE, LOG2_SCALE_END, PackedGaussian, quantised, smallest_three,
};
pub use gaussian_lanes::GaussianLanes;
pub use shared::{
    ALPHA_CUT, CLOSE_LOOK, CROWDED, ITEMS_PER_PART, MOST_TILE_ROWS, SCAN_BLOCK, TEST_SLACK,
    TILE_PIXELS,
};

/// One compiled shader. Its entry point is `main`.
#[derive(Debug, Clone, Copy)]
pub struct Shader {
    /// File name without its extension.
    pub name: &'static str,
    /// SPIR-V 1.3 for Vulkan 1.1, or 1.5 for 1.2 where that is in the shader's documentation.
    pub words: &'static [u32],
}

/// Gaussians that one instance of the quad back end's draw has: as 16-bit indices reach, with six vertices each.
pub const QUADS_PER_INSTANCE: u32 = 1 << 13;

/// Bytes of what the depth sort notes of a crowded bin; `Span` in `shaders/sort_part.glsl`.
pub const SPAN_BYTES: u64 = 16;

/// The depth sort's passes over crowded bins in their order, each with where [`SortState`] says how many workgroups it has: none
/// where no bin is crowded. The specialisation constant is that of the passes over items.
pub const SORT_CROWDED: [(Shader, usize); 6] = [
    (SORT_PART_SPAN, offset_of!(SortState, crowded_groups)),
    (SORT_PART_COUNT, offset_of!(SortState, part_items_groups)),
    (SORT_PART_SCAN, offset_of!(SortState, crowded_groups)),
    (SORT_PART_SCATTER, offset_of!(SortState, part_items_groups)),
    (SORT_PART_ORDER, offset_of!(SortState, parts_groups)),
    (SORT_MERGE, offset_of!(SortState, merge_groups)),
];

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
