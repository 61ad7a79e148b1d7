// Shared by every stage of one picture: cameras, sizes, limits. Mirrors `FrameParams` in src/frame.rs.
#include "numbers.glsl"

const uint NO_DEPTH = 0xFFFFFFFFu;   // start value of a least depth
const uint EMPTY_RECT = 0x00000001u; // first tile behind the last one: covers nothing

struct ViewParams {
    vec4 image_from_world[3]; // rows; image frame: x right, y down, z forward, metres
    vec4 intrinsics;          // fx, fy, cx, cy in pixels
    vec4 slope_limits;        // least and greatest x/z, least and greatest y/z in the Jacobian
    vec4 clip;                // eye position in the world, near plane; metres
};

layout(set = 0, binding = 0, std140) uniform FrameParams {
    ViewParams views[2];
    vec4 depth_plane;         // head depth of p = dot(xyz, p) + w, metres
    uint foreground_count;    // Gaussians 0..foreground_count are the foreground, the rest the background
    uint total_count;
    uint view_count;
    uint width;
    uint height;
    uint tiles_x;
    uint tiles_y;
    uint lane_count;
    uint pair_capacity;
    uint sorts;               // 1 where this picture is sorted, 0 where the last order is kept
    float guard_turn;         // how far an order may be kept: turn of the head in radians ...
    float guard_move;         // ... and its movement in metres
    uint whole_first;         // rows of tiles that are seen wholly in both views, from the middle one up ...
    uint whole_last;          // ... and down; the first is behind the last where there are none
    uvec4 visible_rows[MOST_TILE_ROWS]; // of each row of tiles, first and last column that anyone sees in view 0, the same in view 1
} frame;

// Whether everything in these rows of tiles is seen: most of a picture is, and the look-up below takes as long as several tiles.
bool is_whole(uint first, uint last) { return first >= frame.whole_first && last <= frame.whole_last; }

// First and last column of the tiles of a row that anyone sees; the first is behind the last where nobody sees any.
uvec2 visible_columns(uint view, uint row) {
    uvec4 columns = frame.visible_rows[row];
    return view == 0u ? columns.xy : columns.zw;
}

// A Gaussian as one view sees it. With d = pixel centre - (mean_x, mean_y):
//   alpha = exp2(log2_opacity - (ux*d.x + uy*d.y)^2 - (wy*d.y)^2)
// which is opacity * exp(-q/2) with q from the Cholesky factor of the inverse covariance: for thin
// splats far steadier in f32 than a dx^2 + 2b dx dy + c dy^2.
struct Splat {
    float mean_x, mean_y;
    float ux, uy;
    float wy;
    float log2_opacity;
    uint red_green;  // halves
    uint blue_depth; // halves; depth along this view's axis, metres
};

// ALPHA_CUT, LOG2_ALPHA_CUT, MOST_TILE_ROWS and TILE, the pixels along a tile's side: defined by the build script, from src/shared.rs.
const float ALPHA_MOST = 0.99;
