#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "sort_part.glsl"

// One workgroup per crowded bin: which values and items it has, and its parts made empty.

const uint GROUP = 256u;
layout(local_size_x = 256) in;

shared uint least_value, greatest_value, least_item, greatest_item;

void main() {
    uint bin = crowded[gl_WorkGroupID.x];
    uint start = start_of(bin);
    uint end = bins[bin];
    uint me = gl_LocalInvocationID.x;
    if (me == 0u) {
        least_value = least_item = 0xFFFFFFFFu;
        greatest_value = greatest_item = 0u;
    }
    barrier();
    uvec2 least = uvec2(0xFFFFFFFFu);
    uvec2 greatest = uvec2(0u);
    for (uint at = start + me; at < end; at += GROUP) {
        uvec2 placed = uvec2(placed_values[at], placed_items[at]);
        least = min(least, placed);
        greatest = max(greatest, placed);
    }
    least = subgroupMin(least);
    greatest = subgroupMax(greatest);
    if (subgroupElect()) {
        atomicMin(least_value, least.x);
        atomicMin(least_item, least.y);
        atomicMax(greatest_value, greatest.x);
        atomicMax(greatest_item, greatest.y);
    }
    for (uint part = first_part(start) + me; part < end_part(end); part += GROUP) parts[part] = 0u;
    barrier();
    if (me == 0u) {
        uint value_bits = uint(findMSB(greatest_value - least_value) + 1);
        uint item_bits = uint(findMSB(greatest_item - least_item) + 1);
        spans[span_of(start)] = Span(least_value, least_item, value_bits, item_bits);
    }
}
