#version 450
#extension GL_GOOGLE_include_directive : require
#include "bin.glsl"

layout(constant_id = 0) const uint GROUP = 64u;
layout(local_size_x_id = 0) in;

layout(set = 0, binding = 7, std430) readonly buffer TileStarts { uint tile_starts[]; };
layout(set = 0, binding = 8, std430) writeonly buffer Pairs { uint pairs[]; };

void main() {
    uint lane = gl_GlobalInvocationID.x;
    uint view = gl_GlobalInvocationID.y;
    if (lane >= frame.lane_count || state.refused != 0u) return;
    // Too many for the list: the host reads this total too, grows the list and draws again.
    if (tile_starts[frame.view_count * tile_count()] > frame.pair_capacity) return;
    uint row = (view * frame.lane_count + lane) * tile_count();
    uvec2 run = lane_run(lane);
    for (uint i = run.x; i < run.y; ++i) {
        uint index = order[i];
        uint rect = rects[view * frame.total_count + index];
        if (rect == EMPTY_RECT) continue;
        uint x0 = rect & 255u, y = (rect >> 8) & 255u, x1 = (rect >> 16) & 255u, y1 = rect >> 24;
        bool is_large = (x1 - x0 + 1u) * (y1 - y + 1u) >= CLOSE_LOOK;
        Outline outline;
        if (is_large) outline = outline_of(view, index);
        do {
            uint x = x0, end = x1;
            if (!is_whole(y, y)) {
                uvec2 columns = visible_columns(view, y);
                x = max(x0, columns.x);
                end = min(x1, columns.y);
                if (x > end) continue;
            }
            if (is_large) {
                uvec2 columns = columns_within(outline, y);
                x = max(x, columns.x);
                end = min(end, columns.y);
                if (x > end) continue;
            }
            do {
                uint tile = y * frame.tiles_x + x;
                uint next = table[row + tile];
                table[row + tile] = next + 1u;
                // What a driver lists that it did not count must not leave the lists.
                uint at = tile_starts[view * tile_count() + tile] + next;
                if (at < frame.pair_capacity) pairs[at] = index;
            } while (x++ < end);
        } while (y++ < y1);
    }
}
