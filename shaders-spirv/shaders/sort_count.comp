#version 450
#extension GL_GOOGLE_include_directive : require
#include "sort.glsl"

layout(constant_id = 0) const uint GROUP = 64u;
layout(local_size_x_id = 0) in;

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= params.value_count) return;
    uint value = values[index];
    if (value != DROPPED_VALUE) atomicAdd(bins[key_of(value)], 1u);
}
