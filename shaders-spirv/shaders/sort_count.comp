#version 450
#extension GL_GOOGLE_include_directive : require
#include "sort.glsl"

layout(constant_id = 0) const uint GROUP = 256u;
layout(local_size_x_id = 0) in;

void main() {
    uint at = gl_GlobalInvocationID.x;
    if (at < state.count) atomicAdd(bins[key_of(values[items[at]])], 1u);
}
