#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "project.glsl"
#include "packed_gaussian.glsl"

// One invocation per Gaussian of the foreground, as src/gaussian.rs packs it.

layout(set = 0, binding = 7, std430) readonly buffer Gaussians { PackedGaussian gaussians[]; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    bool kept = false;
    uint depth = 0u;
    if (index < frame.foreground_count) {
        PackedGaussian g = gaussians[index];
        vec3 position = uintBitsToFloat(g.low.xyz);
        float opacity = unpacked_opacity(g);
        uint rect_0 = EMPTY_RECT;
        uint rect_1 = EMPTY_RECT;
        if (opacity > ALPHA_CUT) {
            PlainGaussian plain = unpacked(g);
            mat3 axes = scaled_axes(plain.rotation, exp2(plain.log2_scale));
            Seen left = see(frame.views[0], position, opacity, axes);
            kept = left.kept;
            rect_0 = left.rect;
            if (rect_0 != EMPTY_RECT) {
                paint(left.splat, plain.colour);
                splats_0[index] = left.splat;
            }
            if (frame.view_count > 1u) {
                Seen right = see(frame.views[1], position, opacity, axes);
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
    }
    collect(index, kept, depth, true);
}
