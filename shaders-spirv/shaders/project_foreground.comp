#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "project.glsl"

// One invocation per Gaussian of the foreground, as src/gaussian.rs packs it.

struct PackedGaussian { uint words[8]; };

layout(set = 0, binding = 7, std430) readonly buffer Gaussians { PackedGaussian gaussians[]; };

const float SCALE_STEPS = 2048.0;
const float SCALE_LEAST = -24.0;
const float ROTATION_MOST = 32766.0;
const float SQRT_2 = 1.4142135623730951;

void main() {
    uint index = gl_GlobalInvocationID.x;
    bool kept = false;
    uint depth = 0u;
    if (index < frame.foreground_count) {
        PackedGaussian g = gaussians[index];
        vec3 position = uintBitsToFloat(uvec3(g.words[0], g.words[1], g.words[2]));
        float opacity = float(g.words[4] >> 16) / 65535.0;
        uint rect_0 = EMPTY_RECT;
        uint rect_1 = EMPTY_RECT;
        if (opacity > ALPHA_CUT) {
            vec3 log2_scale = vec3(g.words[3] & 0xFFFFu, g.words[3] >> 16, g.words[4] & 0xFFFFu) / SCALE_STEPS + SCALE_LEAST;
            vec3 steps = vec3(g.words[5] & 0x7FFFu, (g.words[5] >> 15) & 0x7FFFu, g.words[6] & 0xFFFFu);
            vec4 rotation = quaternion(g.words[5] >> 30, (steps / ROTATION_MOST - 0.5) * SQRT_2);
            mat3 axes = scaled_axes(rotation, exp2(log2_scale));
            vec3 colour = vec3(unpackHalf2x16(g.words[6]).y, unpackHalf2x16(g.words[7]));
            Seen left = see(frame.views[0], position, opacity, axes);
            kept = left.kept;
            rect_0 = left.rect;
            if (rect_0 != EMPTY_RECT) {
                paint(left.splat, colour);
                splats_0[index] = left.splat;
            }
            if (frame.view_count > 1u) {
                Seen right = see(frame.views[1], position, opacity, axes);
                kept = kept || right.kept;
                rect_1 = right.rect;
                if (rect_1 != EMPTY_RECT) {
                    paint(right.splat, colour);
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
