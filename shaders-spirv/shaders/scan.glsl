// Exclusive prefix sum in place, in two dispatches: sums of 1,024-element blocks, then each block by itself
// on top of the blocks before it. Sums saturate at 2^32 - 1, so that "too many" never wraps to "few".

// SCAN_BLOCK, the elements of a workgroup: defined by the build script, from src/shared.rs.
const uint SCAN_GROUP = 256u;
const uint PER_INVOCATION = SCAN_BLOCK / SCAN_GROUP;

layout(local_size_x = 256) in;

layout(push_constant) uniform ScanParams { uint element_count; } params;

layout(set = 0, binding = 0, std430) buffer Elements { uint elements[]; };
layout(set = 0, binding = 1, std430) buffer BlockSums { uint block_sums[]; };

// A subgroup is at least 4 wide: at most 64 of them.
shared uint subgroup_sums[64];

uint saturating_add(uint a, uint b) {
    uint sum = a + b;
    return sum < a ? 0xFFFFFFFFu : sum;
}

// Position in the workgroup, subgroup by subgroup: the order that gl_LocalInvocationID usually has, but which
// the specification does not promise.
uint group_index() { return gl_SubgroupID * gl_SubgroupSize + gl_SubgroupInvocationID; }
