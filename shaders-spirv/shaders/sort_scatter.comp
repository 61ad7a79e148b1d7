#version 450
#extension GL_GOOGLE_include_directive : require
#include "sort.glsl"

layout(constant_id = 0) const uint GROUP = 256u;
layout(local_size_x_id = 0) in;

layout(set = 0, binding = 4, std430) writeonly buffer PlacedValues { uint placed_values[]; };
layout(set = 0, binding = 5, std430) writeonly buffer PlacedItems { uint placed_items[]; };

// Leaves in each bin its end, which is the next one's start, in whatever order the atomics fell.
void main() {
    uint at = gl_GlobalInvocationID.x;
    if (at >= state.count) return;
    uint item = items[at];
    uint value = values[item];
    uint place = atomicAdd(bins[key_of(value)], 1u);
    placed_values[place] = value;
    placed_items[place] = item;
}
