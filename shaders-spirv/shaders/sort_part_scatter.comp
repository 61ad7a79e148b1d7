#version 450
#extension GL_GOOGLE_include_directive : require
#include "sort_part.glsl"

layout(constant_id = 0) const uint GROUP = 256u;
layout(local_size_x_id = 0) in;

// Leaves in each part its end.
void main() {
    uint at = gl_GlobalInvocationID.x;
    if (at >= state.count) return;
    uint value = placed_values[at];
    uint bin = key_of(value);
    uint start = start_of(bin);
    uint end = bins[bin];
    if (end - start <= CROWDED) return;
    uint item = placed_items[at];
    order[atomicAdd(parts[part_of(value, item, start, end)], 1u)] = item;
}
