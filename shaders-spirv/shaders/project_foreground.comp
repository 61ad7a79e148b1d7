#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "project.glsl"
#include "packed_gaussian.glsl"

// One invocation per Gaussian of one part of the foreground, as src/gaussian.rs packs it.

// Mirrors `PartParams` in src/frame.rs.
layout(push_constant) uniform PartParams {
    vec4 world_from_part[3]; // rows of a rigid transform, metres
    uint first;              // the part's first Gaussian among the foreground
    uint count;
    uint source;             // and in the buffer it is read from
    uint number;             // for which its tiles are counted
} part;

layout(set = 0, binding = 7, std430) readonly buffer Gaussians { PackedGaussian gaussians[]; };
#define COSTS_BINDING 8
#include "costs.glsl"

uint tiles_of(uint rect) {
    if (rect == EMPTY_RECT) return 0u;
    return (((rect >> 16) & 255u) - (rect & 255u) + 1u) * ((rect >> 24) - ((rect >> 8) & 255u) + 1u);
}

// All invocations of the subgroup call this together.
void count_pairs(uint tiles) {
    uint sum = subgroupAdd(tiles);
    if (sum > 0u && subgroupElect()) {
        uint before = atomicAdd(costs.pairs[2u * part.number], sum);
        if (before + sum < before) atomicAdd(costs.pairs[2u * part.number + 1u], 1u);
    }
}

void main() {
    uint local = gl_GlobalInvocationID.x;
    uint index = part.first + local;
    bool kept = false;
    uint depth = 0u;
    uint tiles = 0u;
    if (local < part.count) {
        PackedGaussian g = gaussians[part.source + local];
        vec4 p = vec4(uintBitsToFloat(g.low.xyz), 1.0);
        vec4 x = part.world_from_part[0], y = part.world_from_part[1], z = part.world_from_part[2];
        vec3 position = vec3(dot(x, p), dot(y, p), dot(z, p));
        float opacity = unpacked_opacity(g);
        uint rect_0 = EMPTY_RECT;
        uint rect_1 = EMPTY_RECT;
        if (opacity > ALPHA_CUT) {
            PlainGaussian plain = unpacked(g);
            mat3 axes_in_part = scaled_axes(plain.rotation, exp2(plain.log2_scale));
            mat3 axes = transpose(mat3(x.xyz * axes_in_part, y.xyz * axes_in_part, z.xyz * axes_in_part));
            Seen left = see(0u, position, opacity, axes);
            kept = left.kept;
            rect_0 = left.rect;
            if (rect_0 != EMPTY_RECT) {
                paint(left.splat, plain.colour);
                splats_0[index] = left.splat;
            }
            if (frame.view_count > 1u) {
                Seen right = see(1u, position, opacity, axes);
                kept = kept || right.kept;
                rect_1 = right.rect;
                if (rect_1 != EMPTY_RECT) {
                    paint(right.splat, plain.colour);
                    splats_1[index] = right.splat;
                }
            }
            depth = depth_bits(position);
        }
        rects[index] = rect_0;
        if (frame.view_count > 1u) rects[frame.total_count + index] = rect_1;
        tiles = tiles_of(rect_0) + tiles_of(rect_1);
    }
    count_pairs(tiles);
    collect(index, kept, depth, true);
}
