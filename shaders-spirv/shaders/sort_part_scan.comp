#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "sort_part.glsl"

// One workgroup per crowded bin: from how many items each part has to where its first one goes.

const uint GROUP = 256u;
const uint PER_INVOCATION = 4u;
layout(local_size_x = 256) in;

// A subgroup is at least 4 wide: at most 64 of them.
shared uint subgroup_sums[64];
shared uint next; // where the first item of the next block of parts goes

void main() {
    uint bin = crowded[gl_WorkGroupID.x];
    uint start = start_of(bin);
    uint end = end_part(bins[bin]);
    // Subgroup by subgroup, as in scan.glsl.
    uint me = gl_SubgroupID * gl_SubgroupSize + gl_SubgroupInvocationID;
    if (me == 0u) next = start;
    for (uint block = first_part(start); block < end; block += GROUP * PER_INVOCATION) {
        uint first = block + me * PER_INVOCATION;
        uint own[PER_INVOCATION];
        uint sum = 0u;
        for (uint i = 0u; i < PER_INVOCATION; ++i) {
            own[i] = first + i < end ? parts[first + i] : 0u;
            sum += own[i];
        }
        uint before = subgroupExclusiveAdd(sum);
        uint subgroup_sum = subgroupAdd(sum);
        if (subgroupElect()) subgroup_sums[gl_SubgroupID] = subgroup_sum;
        barrier();
        if (me == 0u) {
            for (uint i = 0u; i < gl_NumSubgroups; ++i) {
                uint added = subgroup_sums[i];
                subgroup_sums[i] = next;
                next += added;
            }
        }
        barrier();
        uint running = subgroup_sums[gl_SubgroupID] + before;
        for (uint i = 0u; i < PER_INVOCATION; ++i) {
            if (first + i < end) parts[first + i] = running;
            running += own[i];
        }
        // The sums are read before the next block's take their place.
        barrier();
    }
}
