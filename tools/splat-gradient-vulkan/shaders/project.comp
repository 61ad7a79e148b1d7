#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "seen.glsl"

// From Gaussians to splats, and those of them that are drawn to the sort's input (shaders-spirv/shaders/sort.glsl).

layout(set = 0, binding = 1, std430) writeonly buffer Splats { Splat splats[]; };
// By Gaussian, and 0 at the end: how many tiles its rectangle has.
layout(set = 0, binding = 2, std430) writeonly buffer Areas { uint areas[]; };
layout(set = 0, binding = 3, std430) writeonly buffer Depths { uint depths[]; };
layout(set = 0, binding = 4, std430) writeonly buffer Items { uint items[]; };
// The first numbers of `SortState` of shaders-spirv.
layout(set = 0, binding = 5, std430) buffer State {
    uint count;
    uint least, greatest;
    uint fine_least, fine_greatest;
} state;

const float SQRT_HALF_LOG2_E = 0.8493218;
const float LN_2 = 0.6931471805599453;

// Tiles of its rectangle; 0 where it is not drawn.
uint project(uint index, out uint depth) {
    depth = 0u;
    Seen s = see(index);
    if (!s.sound) return 0u;
    float product = s.c * s.determinant;
    float log2_opacity = log2(s.opacity);
    // Where alpha reaches the cut: by opacity, not by three standard deviations.
    float q_cut = (log2_opacity - LOG2_ALPHA_CUT) * (2.0 * LN_2);
    if (!(q_cut > 0.0)) return 0u;
    vec2 reach = sqrt(q_cut * vec2(s.a, s.c));
    vec2 mean = s.place.xy * s.inverse_depth * camera.lens.xy + camera.lens.zw;
    if (!finite(mean.x + mean.y + reach.x + reach.y) || !finite(product)) return 0u;
    // The first and the last pixel centre inside; there may be none.
    vec2 first = max(ceil(mean - reach - 0.5), vec2(0.0));
    vec2 last = min(floor(mean + reach - 0.5), vec2(camera.width, camera.height) - 1.0);
    if (first.x > last.x || first.y > last.y) return 0u;

    float across = SQRT_HALF_LOG2_E / sqrt(product);
    uvec2 low = uvec2(first), high = uvec2(last);
    vec3 colour = max(s.colour, vec3(0.0));
    splats[index] = Splat(mean.x, mean.y, across * s.c, -across * s.b, SQRT_HALF_LOG2_E / sqrt(s.c), log2_opacity,
        colour.r, colour.g, colour.b, low.x | (high.x << 16), low.y | (high.y << 16));
    // Beyond the near plane: the bits rise with the depth.
    depth = floatBitsToUint(s.place.z);
    uvec2 tiles = high / TILE - low / TILE + 1u;
    return tiles.x * tiles.y;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    uint area = 0u, depth = 0u;
    if (index < camera.count) area = project(index, depth);
    if (index <= camera.count) areas[index] = area;

    bool drawn = area > 0u;
    uvec4 ballot = subgroupBallot(drawn);
    uint found = subgroupBallotBitCount(ballot);
    if (found == 0u) return;
    uint first = 0u;
    uint least = subgroupMin(drawn ? depth : NONE);
    uint greatest = subgroupMax(depth);
    if (subgroupElect()) {
        first = atomicAdd(state.count, found);
        atomicMin(state.least, least);
        atomicMin(state.fine_least, least);
        atomicMax(state.greatest, greatest);
        atomicMax(state.fine_greatest, greatest);
    }
    first = subgroupBroadcastFirst(first);
    if (drawn) {
        items[first + subgroupBallotExclusiveBitCount(ballot)] = index;
        depths[index] = depth;
    }
}
