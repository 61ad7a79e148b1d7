//! Shared by every stage of one picture. Offsets are checked against the compiled shaders in
//! `tests/layout.rs`.

use crate::MOST_TILE_ROWS;
use bytemuck::{Pod, Zeroable};

/// One view's camera; `ViewParams` in `shaders/frame.glsl` (std140).
///
/// The image frame is `OpenCV`'s: x right, y down, z forward, metres.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ViewParams {
    /// Rows of the 3x4 rigid transform.
    pub image_from_world: [[f32; 4]; 3],
    /// `fx, fy, cx, cy` in pixels.
    pub intrinsics: [f32; 4],
    /// Least and greatest `x/z`, least and greatest `y/z` at which the Jacobian is taken.
    pub slope_limits: [f32; 4],
    /// The eye's position in the world, then the near plane; metres.
    pub clip: [f32; 4],
}

/// For each row of tiles from the top, the first and the last column that anyone sees in the left (or only) view, and the same in the right one;
/// the first is behind the last where nobody sees any. The rows that a picture lacks are not read.
pub type VisibleRows = [[u32; 4]; MOST_TILE_ROWS];

/// Cameras, sizes and limits of one picture; `FrameParams` in `shaders/frame.glsl` (std140).
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FrameParams {
    /// One or two views.
    pub views: [ViewParams; 2],
    /// Depth of a world point from the head centre: `dot(xyz, p) + w`, metres.
    pub depth_plane: [f32; 4],
    /// Gaussians of the foreground, which come first.
    pub foreground_count: u32,
    /// Gaussians of foreground and background.
    pub total_count: u32,
    /// 1 or 2.
    pub view_count: u32,
    /// Picture width, pixels.
    pub width: u32,
    /// Picture height, pixels.
    pub height: u32,
    /// Tiles per row.
    pub tiles_x: u32,
    /// Rows of tiles.
    pub tiles_y: u32,
    /// Invocations that share the sorted splats among them when tiles are filled.
    pub lane_count: u32,
    /// Entries the tile lists have room for.
    pub pair_capacity: u32,
    /// 1 where the Gaussians are sorted, 0 where the last one is kept.
    pub sorts: u32,
    /// How far the head may turn, radians, while an order is kept.
    pub guard_turn: f32,
    /// How far the head may move, metres, while an order is kept.
    pub guard_move: f32,
    /// The first of the rows of tiles that are seen wholly, in both views.
    pub whole_first: u32,
    /// The last of them; before the first where there are none.
    pub whole_last: u32,
    /// Nothing: `std140` puts arrays at multiples of 16 bytes.
    pub padding: [u32; 2],
    /// What anyone sees of each row of tiles.
    pub visible_rows: VisibleRows,
}

/// Which Gaussians of the foreground a dispatch projects, and where they stand; `PartParams` in
/// `shaders/project_foreground.comp`, push constants.
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PartParams {
    /// Rows of the 3x4 rigid transform, metres.
    pub world_from_part: [[f32; 4]; 3],
    /// The part's first Gaussian among the foreground.
    pub first: u32,
    /// How many it has.
    pub count: u32,
    /// Where the first lies in the buffer they are read from.
    pub source: u32,
    /// The part's number, for which its tiles are counted.
    pub number: u32,
}

/// A Gaussian as one view sees it, 32 bytes; `Splat` in `shaders/frame.glsl`, written and read by the GPU alone.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Splat {
    /// Centre in the image, pixels from the left edge.
    pub mean_x: f32,
    /// Centre in the image, pixels from the top edge.
    pub mean_y: f32,
    /// Root of the inverse covariance, scaled so that squares are in units of log2.
    pub ux: f32,
    /// As `ux`, for the vertical offset.
    pub uy: f32,
    /// As `ux`, second row: reads the vertical offset alone.
    pub wy: f32,
    /// Logarithm to base 2 of the opacity.
    pub log2_opacity: f32,
    /// Red and green as two halves.
    pub red_green: u32,
    /// Blue, and the depth along the view's axis in metres, as two halves.
    pub blue_depth: u32,
}

/// What the sort counts and how later passes are dispatched; `State` in `shaders/state.glsl`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SortState {
    /// Items to sort.
    pub count: u32,
    /// Least value of all items.
    pub least: u32,
    /// Greatest value of all items.
    pub greatest: u32,
    /// Least value of the range with fine keys.
    pub fine_least: u32,
    /// Greatest value of that range.
    pub fine_greatest: u32,
    /// First key of the fine range.
    pub linear_start: u32,
    /// Keys of the fine range.
    pub linear_keys: u32,
    /// Keys a metre in the fine range.
    pub linear_scale: f32,
    /// Value bits a key outside of it.
    pub log_shift: u32,
    /// Workgroups of a pass over the items.
    pub items_groups: [u32; 3],
    /// Workgroups of the passes over crowded bins.
    pub crowded_groups: [u32; 3],
    /// Workgroups of a pass over the items where bins are crowded, and none otherwise.
    pub part_items_groups: [u32; 3],
    /// Workgroups of the pass over the parts of crowded bins.
    pub parts_groups: [u32; 3],
    /// Workgroups of the pass over parts that are crowded themselves.
    pub merge_groups: [u32; 3],
    /// `VkDrawIndexedIndirectCommand` of the quads.
    pub draw: [u32; 5],
    /// 1 where the foreground covers too many tiles and nothing may be drawn.
    pub refused: u32,
}

impl SortState {
    /// Before anything was collected.
    pub const EMPTY: Self = Self {
        count: 0,
        least: u32::MAX,
        greatest: 0,
        fine_least: u32::MAX,
        fine_greatest: 0,
        linear_start: 0,
        linear_keys: 0,
        linear_scale: 0.0,
        log_shift: 0,
        items_groups: [0; 3],
        crowded_groups: [0; 3],
        part_items_groups: [0; 3],
        parts_groups: [0; 3],
        merge_groups: [0; 3],
        draw: [0; 5],
        refused: 0,
    };
}
