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

uint tile_count() { return frame.tiles_x * frame.tiles_y; }

uvec2 lane_run(uint lane) {
    uint total = state.count;
    uint per_lane = (total + frame.lane_count - 1u) / frame.lane_count;
    uint start = min(lane * per_lane, total);
    return uvec2(start, min(start + per_lane, total));
}
