#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "scan.glsl"

void main() {
    uint first = gl_WorkGroupID.x * SCAN_BLOCK + group_index() * PER_INVOCATION;
    uint sum = 0u;
    for (uint i = first; i < min(first + PER_INVOCATION, params.element_count); ++i) sum += elements[i];
    sum = subgroupAdd(sum);
    if (subgroupElect()) subgroup_sums[gl_SubgroupID] = sum;
    barrier();
    if (group_index() == 0u) {
        uint total = 0u;
        for (uint i = 0u; i < gl_NumSubgroups; ++i) total = saturating_add(total, subgroup_sums[i]);
        block_sums[gl_WorkGroupID.x] = total;
    }
}
