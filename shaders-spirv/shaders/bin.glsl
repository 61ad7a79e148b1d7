// Which splats touch which tile, front to back, without a second sort: each of `lane_count` lanes walks a
// contiguous run of the sorted splats and counts into a row of its own, so no atomics and a fixed order.
#include "frame.glsl"

layout(set = 0, binding = 1, std430) readonly buffer Order { uint order[]; };
#define STATE_BINDING 2
#define STATE_ACCESS readonly
#include "state.glsl"
layout(set = 0, binding = 3, std430) readonly buffer Rects { uint rects[]; };
// [view][lane][tile]: first the lane's splats on the tile, then where its next one goes in the tile's list.
layout(set = 0, binding = 4, std430) buffer Table { uint table[]; };
layout(set = 0, binding = 5, std430) readonly buffer Splats0 { Splat splats_0[]; };
layout(set = 0, binding = 6, std430) readonly buffer Splats1 { Splat splats_1[]; };

uint tile_count() { return frame.tiles_x * frame.tiles_y; }

// A rectangle of fewer tiles than CLOSE_LOOK is about what its splat touches: looking closer takes longer than it saves. TEST_SLACK: room for
// rounding; both are defined by the build script, from src/shared.rs. And room of a pixel, to which more comes where coordinates are large.
const float PIXEL_SLACK = 0.05;
const float PIXEL_ROUNDING = 5e-7;

// Where a splat's alpha reaches ALPHA_CUT, from its mean: (ux*x + uy*y)^2 + (wy*y)^2 = level.
struct Outline {
    float mean_x, mean_y;
    float uy, wy, inv_ux;
    float level;
    float tip; // y of its leftmost point; its rightmost is as far above
};

// Those who count and those who list must find the same tiles, to the bit: all of it is `precise`, so that no compiler joins a product and a sum
// in one of the two alone.
Outline outline_of(uint view, uint index) {
    Splat s;
    if (view == 0u) s = splats_0[index];
    else s = splats_1[index];
    precise float level = s.log2_opacity - LOG2_ALPHA_CUT + TEST_SLACK;
    precise float inv_ux = 1.0 / s.ux;
    precise float tip = s.uy / s.wy * sqrt(level / (s.uy * s.uy + s.wy * s.wy));
    return Outline(s.mean_x, s.mean_y, s.uy, s.wy, inv_ux, level, tip);
}

// First and last column of a row's tiles in which it has a pixel's centre; the first is behind the last where it has none.
uvec2 columns_within(Outline o, uint row) {
    precise float top = float(row * TILE) + 0.5 - o.mean_y;
    precise float bottom = top + float(TILE - 1u);
    // Its sides bulge towards the tips.
    precise float y_left = clamp(o.tip, top, bottom);
    precise float y_right = clamp(-o.tip, top, bottom);
    precise float across_left = o.wy * y_left;
    precise float across_right = o.wy * y_right;
    precise float left = (-o.uy * y_left - sqrt(max(o.level - across_left * across_left, 0.0))) * o.inv_ux;
    precise float right = (-o.uy * y_right + sqrt(max(o.level - across_right * across_right, 0.0))) * o.inv_ux;
    precise float slack = PIXEL_SLACK + PIXEL_ROUNDING * (abs(o.mean_x) + abs(o.uy * o.inv_ux) * max(abs(top), abs(bottom)));
    precise float first = ceil(o.mean_x + left - 0.5 - slack);
    precise float last = floor(o.mean_x + right - 0.5 + slack);
    uvec2 columns = uvec2(clamp(vec2(first, last), 0.0, 65535.0)) / TILE;
    return last < max(first, 0.0) ? uvec2(1u, 0u) : columns;
}

uvec2 lane_run(uint lane) {
    uint total = state.count;
    uint per_lane = (total + frame.lane_count - 1u) / frame.lane_count;
    uint start = min(lane * per_lane, total);
    return uvec2(start, min(start + per_lane, total));
}
