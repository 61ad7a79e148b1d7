#version 450
#extension GL_GOOGLE_include_directive : require
#include "bin.glsl"

layout(constant_id = 0) const uint GROUP = 64u;
layout(local_size_x_id = 0) in;

void main() {
    uint lane = gl_GlobalInvocationID.x;
    uint view = gl_GlobalInvocationID.y;
    if (lane >= frame.lane_count || state.refused != 0u) return;
    uint row = (view * frame.lane_count + lane) * tile_count();
    uvec2 run = lane_run(lane);
    for (uint i = run.x; i < run.y; ++i) {
        uint rect = rects[view * frame.total_count + order[i]];
        if (rect == EMPTY_RECT) continue;
        uint x0 = rect & 255u, y = (rect >> 8) & 255u, x1 = (rect >> 16) & 255u, y1 = rect >> 24;
        bool is_large = (x1 - x0 + 1u) * (y1 - y + 1u) >= CLOSE_LOOK;
        Outline outline;
        if (is_large) outline = outline_of(view, order[i]);
        // Tested at their ends, as in raster.glsl.
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
                table[row + y * frame.tiles_x + x] += 1u;
            } while (x++ < end);
        } while (y++ < y1);
    }
}
