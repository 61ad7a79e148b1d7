#version 450
#extension GL_GOOGLE_include_directive : require
#include "lists.glsl"

// Of each tile: where each lane's splats go in its list, and how many there are. One invocation more leaves 0 at the end.

layout(set = 0, binding = 0, std430) buffer Table { uint table[]; };
layout(set = 0, binding = 1, std430) writeonly buffer TileStarts { uint tile_starts[]; };

void main() {
    uint tile = gl_GlobalInvocationID.x;
    if (tile > tile_count()) return;
    uint sum = 0u;
    if (tile < tile_count()) {
        for (uint lane = 0u; lane < lists.lanes; ++lane) {
            uint cell = lane * tile_count() + tile;
            uint own = table[cell];
            table[cell] = sum;
            sum += own;
        }
    }
    tile_starts[tile] = sum;
}
