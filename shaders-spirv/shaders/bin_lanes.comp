#version 450
#extension GL_GOOGLE_include_directive : require
#include "bin.glsl"

layout(constant_id = 0) const uint GROUP = 64u;
layout(local_size_x_id = 0) in;

// [view][tile] splats on the tile, to be scanned into the start of its list; the last element stays 0.
layout(set = 0, binding = 7, std430) writeonly buffer TileStarts { uint tile_starts[]; };

void main() {
    uint tile = gl_GlobalInvocationID.x;
    uint view = gl_GlobalInvocationID.y;
    if (tile >= tile_count()) return;
    uint sum = 0u;
    for (uint lane = 0u; lane < frame.lane_count; ++lane) {
        uint cell = (view * frame.lane_count + lane) * tile_count() + tile;
        uint own = table[cell];
        table[cell] = sum;
        sum += own;
    }
    tile_starts[view * tile_count() + tile] = sum;
}
