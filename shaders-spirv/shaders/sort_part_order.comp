#version 450
#extension GL_GOOGLE_include_directive : require
#include "sort_part.glsl"

// One invocation per part: its few items, by (value, item). A part that is crowded itself, since the values of its bin lie far
// apart and yet close together, is left to a whole workgroup of sort_merge.comp.

layout(constant_id = 0) const uint GROUP = 256u;
layout(local_size_x_id = 0) in;

void main() {
    uint part = gl_GlobalInvocationID.x;
    uint at = part * ITEMS_PER_PART;
    if (at >= state.count) return;
    uint bin = key_of(placed_values[at]);
    uint bin_start = start_of(bin);
    uint bin_end = bins[bin];
    if (bin_end - bin_start <= CROWDED || part >= end_part(bin_end)) return;
    uvec2 own = items_of(part, bin_start);
    if (own.y - own.x > CROWDED) {
        crowded[atomicAdd(state.merge_groups[0], 1u)] = part;
        return;
    }
    for (uint i = own.x + 1u; i < own.y; ++i) {
        uint item = order[i];
        uint value = values[item];
        uint hole = i;
        while (hole > own.x) {
            uint before = order[hole - 1u];
            uint before_value = values[before];
            if (before_value < value || (before_value == value && before < item)) break;
            order[hole] = before;
            --hole;
        }
        if (hole != i) order[hole] = item;
    }
}
