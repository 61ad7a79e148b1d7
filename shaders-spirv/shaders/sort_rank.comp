#version 450
#extension GL_GOOGLE_include_directive : require
#include "sort.glsl"

layout(constant_id = 0) const uint GROUP = 256u;
layout(local_size_x_id = 0) in;

layout(set = 0, binding = 4, std430) readonly buffer PlacedValues { uint placed_values[]; };
layout(set = 0, binding = 5, std430) readonly buffer PlacedItems { uint placed_items[]; };
layout(set = 0, binding = 6, std430) writeonly buffer Order { uint order[]; };
layout(set = 0, binding = 7, std430) writeonly buffer Crowded { uint crowded[]; };

// One invocation per placed item: its place within its bin is how many come before it there by (value, item), whatever
// order the scatter's atomics fell in. A crowded bin is left to the passes of sort_part.glsl.
void main() {
    uint at = gl_GlobalInvocationID.x;
    if (at >= state.count) return;
    uint value = placed_values[at];
    uint item = placed_items[at];
    uint bin = key_of(value);
    uint start = start_of(bin);
    uint end = bins[bin];
    if (end - start > CROWDED) {
        if (at == start) {
            crowded[atomicAdd(state.crowded_groups[0], 1u)] = bin;
            // The same from every crowded bin.
            state.part_items_groups[0] = state.items_groups[0];
            state.parts_groups[0] = (state.count / ITEMS_PER_PART + GROUP) / GROUP;
        }
        return;
    }
    uint rank = start;
    for (uint other = start; other < end; ++other) {
        uint other_value = placed_values[other];
        rank += other_value < value ? 1u : 0u;
        if (other_value == value && other != at) rank += placed_items[other] < item ? 1u : 0u;
    }
    order[rank] = item;
}
