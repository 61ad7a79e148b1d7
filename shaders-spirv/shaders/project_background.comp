#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "project.glsl"

// One invocation per Gaussian of one chunk of the background, as xr-renderer/splat/src/background.rs packs it: 20 bytes
// relative to a block of 256 neighbours, and spherical harmonics in bytes.

layout(constant_id = 2) const uint SH_WORDS = 0u; // per Gaussian: 0, 3, 6 or 12 for degrees 0..3

layout(push_constant) uniform ChunkParams {
    uint first;  // the chunk's first Gaussian among the background
    uint count;
} chunk;

struct PackedStatic { uint words[5]; };

// Mirrors `Block` in src/background.rs.
struct Block {
    vec4 origin;      // least position, metres; reach: greatest radius at which alpha could be ALPHA_CUT
    vec4 step_scale;  // size of a position step on each axis; least log2(scale)
    vec4 steps;       // of log2(scale); least colour coefficient; step of that
    vec4 harmonics;   // steps of the coefficients of degree 1, 2 and 3
};

layout(set = 0, binding = 7, std430) readonly buffer Gaussians { PackedStatic gaussians[]; };
layout(set = 0, binding = 8, std430) readonly buffer Blocks { Block blocks[]; };
layout(set = 0, binding = 9, std430) readonly buffer Harmonics { uint harmonics[]; };

const uint BLOCK = 256u;
const float SH_C0 = 0.28209479177387814;

// Whether any of a box's points, reach added, may be in the picture: all eight corners beyond one plane say no.
bool may_see(ViewParams v, vec3 low, vec3 high) {
    vec3 centre = 0.5 * (low + high);
    vec3 extent = 0.5 * (high - low);
    vec4 p = vec4(centre, 1.0);
    vec3 t = vec3(dot(v.image_from_world[0], p), dot(v.image_from_world[1], p), dot(v.image_from_world[2], p));
    vec3 x = v.image_from_world[0].xyz, y = v.image_from_world[1].xyz, z = v.image_from_world[2].xyz;
    if (t.z + dot(abs(z), extent) < v.clip.w - frame.guard_move) return false;
    // Beyond the limits of the Jacobian nothing reaches back into the picture but what is wider than it thinks.
    vec4 edges = v.slope_limits;
    return t.x - edges.x * t.z + dot(abs(x - edges.x * z), extent) > 0.0
        && edges.y * t.z - t.x + dot(abs(edges.y * z - x), extent) > 0.0
        && t.y - edges.z * t.z + dot(abs(y - edges.z * z), extent) > 0.0
        && edges.w * t.z - t.y + dot(abs(edges.w * z - y), extent) > 0.0;
}

float coefficient(uint base, uint index) {
    return float(bitfieldExtract(int(harmonics[base + index / 4u]), int(index % 4u) * 8, 8));
}

vec3 coefficients(uint base, uint k) {
    return vec3(coefficient(base, 3u * k), coefficient(base, 3u * k + 1u), coefficient(base, 3u * k + 2u));
}

// Degrees 1 to 3 at a unit direction from the eye to the Gaussian; constants and order as in 3DGS.
vec3 higher_harmonics(uint base, vec3 d, vec3 steps) {
    float x = d.x, y = d.y, z = d.z;
    vec3 sum = steps.x * 0.4886025119029199 * (-y * coefficients(base, 0u) + z * coefficients(base, 1u) - x * coefficients(base, 2u));
    if (SH_WORDS > 3u) {
        float xx = x * x, yy = y * y, zz = z * z;
        sum += steps.y * (1.0925484305920792 * x * y * coefficients(base, 3u)
            - 1.0925484305920792 * y * z * coefficients(base, 4u)
            + 0.31539156525252005 * (2.0 * zz - xx - yy) * coefficients(base, 5u)
            - 1.0925484305920792 * x * z * coefficients(base, 6u)
            + 0.5462742152960396 * (xx - yy) * coefficients(base, 7u));
        if (SH_WORDS > 6u) {
            sum += steps.z * (-0.5900435899266435 * y * (3.0 * xx - yy) * coefficients(base, 8u)
                + 2.890611442640554 * x * y * z * coefficients(base, 9u)
                - 0.4570457994644658 * y * (4.0 * zz - xx - yy) * coefficients(base, 10u)
                + 0.3731763325901154 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy) * coefficients(base, 11u)
                - 0.4570457994644658 * x * (4.0 * zz - xx - yy) * coefficients(base, 12u)
                + 1.445305721320277 * z * (xx - yy) * coefficients(base, 13u)
                - 0.5900435899266435 * x * (xx - 3.0 * yy) * coefficients(base, 14u));
        }
    }
    return sum;
}

vec3 colour_from(ViewParams v, vec3 position, vec3 base_colour, uint local, vec3 sh_steps) {
    if (SH_WORDS == 0u) return base_colour;
    vec3 direction = normalize(position - v.clip.xyz);
    return base_colour + higher_harmonics(local * SH_WORDS, direction, sh_steps);
}

void main() {
    uint local = gl_GlobalInvocationID.x;
    uint index = frame.foreground_count + chunk.first + local;
    bool kept = false;
    uint depth = 0u;
    if (local < chunk.count) {
        uint rect_0 = EMPTY_RECT;
        uint rect_1 = EMPTY_RECT;
        // The group lies in one block: all its invocations go the same way.
        Block block = blocks[gl_WorkGroupID.x * GROUP / BLOCK];
        vec3 low = block.origin.xyz - block.origin.w;
        vec3 high = block.origin.xyz + 65535.0 * block.step_scale.xyz + block.origin.w;
        bool possible = may_see(frame.views[0], low, high);
        if (frame.view_count > 1u) possible = possible || may_see(frame.views[1], low, high);
        if (possible) {
            PackedStatic g = gaussians[local];
            float opacity = float(bitfieldExtract(g.words[1], 16, 8)) / 255.0;
            // A block is filled up with Gaussians that show nowhere.
            if (opacity > ALPHA_CUT) {
                vec3 steps = vec3(g.words[0] & 0xFFFFu, g.words[0] >> 16, g.words[1] & 0xFFFFu);
                vec3 position = block.origin.xyz + steps * block.step_scale.xyz;
                uvec3 scale_steps = uvec3(g.words[2] & 0xFFFu, bitfieldExtract(g.words[2], 12, 12),
                                          (g.words[1] >> 24) | (bitfieldExtract(g.words[2], 24, 4) << 8));
                vec3 log2_scale = block.step_scale.w + block.steps.x * vec3(scale_steps);
                uvec3 turn = uvec3((g.words[2] >> 28) | ((g.words[3] & 0xFFu) << 4), bitfieldExtract(g.words[3], 8, 12), g.words[3] >> 20);
                vec4 rotation = quaternion(g.words[4] >> 30, (vec3(turn) / 4094.0 - 0.5) * SQRT_2);
                uvec3 colour_steps = uvec3(g.words[4] & 0x3FFu, bitfieldExtract(g.words[4], 10, 10), bitfieldExtract(g.words[4], 20, 10));
                vec3 base_colour = 0.5 + SH_C0 * (block.steps.y + block.steps.z * vec3(colour_steps));
                mat3 axes = scaled_axes(rotation, exp2(log2_scale));
                Seen left = see(0u, position, opacity, axes);
                kept = left.kept;
                rect_0 = left.rect;
                if (rect_0 != EMPTY_RECT) splats_0[index] = left.splat;
                Seen right;
                if (frame.view_count > 1u) {
                    right = see(1u, position, opacity, axes);
                    kept = kept || right.kept;
                    rect_1 = right.rect;
                    if (rect_1 != EMPTY_RECT) splats_1[index] = right.splat;
                }
                if (rect_0 != EMPTY_RECT) {
                    paint(left.splat, colour_from(frame.views[0], position, base_colour, local, block.harmonics.xyz));
                    splats_0[index].red_green = left.splat.red_green;
                    splats_0[index].blue_depth = left.splat.blue_depth;
                }
                if (rect_1 != EMPTY_RECT) {
                    paint(right.splat, colour_from(frame.views[1], position, base_colour, local, block.harmonics.xyz));
                    splats_1[index].red_green = right.splat.red_green;
                    splats_1[index].blue_depth = right.splat.blue_depth;
                }
                depth = depth_bits(position);
            }
        }
        rects[index] = rect_0;
        if (frame.view_count > 1u) rects[frame.total_count + index] = rect_1;
    }
    collect(index, kept, depth, false);
}
