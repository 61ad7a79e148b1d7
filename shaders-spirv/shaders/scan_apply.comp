#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "scan.glsl"

void main() {
    uint first = gl_WorkGroupID.x * SCAN_BLOCK + group_index() * PER_INVOCATION;
    uint own[PER_INVOCATION];
    uint sum = 0u;
    for (uint i = 0u; i < PER_INVOCATION; ++i) {
        own[i] = first + i < params.element_count ? elements[first + i] : 0u;
        sum += own[i];
    }
    uint before = subgroupExclusiveAdd(sum);
    uint subgroup_sum = subgroupAdd(sum);
    if (subgroupElect()) subgroup_sums[gl_SubgroupID] = subgroup_sum;
    barrier();
    if (group_index() == 0u) {
        uint total = 0u;
        for (uint i = 0u; i < gl_WorkGroupID.x; ++i) total = saturating_add(total, block_sums[i]);
        for (uint i = 0u; i < gl_NumSubgroups; ++i) {
            uint added = subgroup_sums[i];
            subgroup_sums[i] = total;
            total = saturating_add(total, added);
        }
    }
    barrier();
    uint running = saturating_add(subgroup_sums[gl_SubgroupID], before);
    for (uint i = 0u; i < PER_INVOCATION; ++i) {
        if (first + i < params.element_count) elements[first + i] = running;
        running = saturating_add(running, own[i]);
    }
}
