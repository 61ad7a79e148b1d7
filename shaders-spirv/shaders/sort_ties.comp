#version 450
#extension GL_GOOGLE_include_directive : require
#include "sort.glsl"
#include "sort_order.glsl"

layout(constant_id = 0) const uint GROUP = 64u;
layout(local_size_x_id = 0) in;

layout(set = 0, binding = 5, std430) writeonly buffer Crowded { uint crowded[]; };

// One invocation per bin: (value, item) order, whatever order the scatter's atomics fell in. A crowded bin is left to
// a whole workgroup of sort_crowded.comp.
void main() {
    uint bin = gl_GlobalInvocationID.x;
    if (bin >= bins.length()) return;
    uint start = bin == 0u ? 0u : bins[bin - 1u];
    uint end = bins[bin];
    if (end - start < 2u) return;
    if (end - start <= CROWDED) insertion_sort(start, end);
    else crowded[atomicAdd(state.crowded_groups[0], 1u)] = bin;
}
