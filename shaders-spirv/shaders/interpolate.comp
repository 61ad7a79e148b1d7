#version 450
#extension GL_GOOGLE_include_directive : require
#include "packed_gaussian.glsl"

// Gaussians between two states, or a little beyond the second: rotations along the shortest arc, the rest linearly. All,
// or those of a list. One invocation each.

layout(constant_id = 0) const uint GROUP = 64u;
layout(local_size_x_id = 0) in;

layout(push_constant) uniform Params {
    uint gaussian_count; // to be made
    uint first_from;     // where the earlier state begins
    uint first_to;       // where the later one does
    float share;         // 0: the earlier, 1: the later, up to 2: as far beyond
    uint first_kept;     // where the list begins, or ALL
} params;

layout(set = 0, binding = 0, std430) readonly buffer States { PackedGaussian states[]; };
layout(set = 0, binding = 1, std430) writeonly buffer Gaussians { PackedGaussian gaussians[]; };
layout(set = 0, binding = 2, std430) readonly buffer Kept { uint kept[]; };

const uint ALL = 0xFFFFFFFFu;

// A kept Gaussian's word: its index below its growth, of which an octave has so many steps.
const uint GROWTH_SHIFT = 24u;
const float GROWTH_STEPS = 64.0;

const uint TERMS = 8u;

// sin(t angle) / sin(angle) for two t, as power series in s = sin(angle / 2)^2 <= 1/2 (after Eberly, "A Fast and Accurate
// Algorithm for Computing SLERP", 2011): no division where the angle is small, and no device-dependent sine. The rest of the series is
// approximated by a geometric series.
vec2 slerp_weights(vec2 t, float s) {
    vec2 sum = vec2(1.0 / (1.0 - s));
    for (uint k = TERMS; k > 0u; --k) {
        float n = float(k);
        sum = 1.0 + sum * s * (n * n - t * t) / (n * (n + 0.5));
    }
    return t * sum;
}

vec4 slerp(vec4 from, vec4 to, float share) {
    float cosine = dot(from, to);
    vec4 near = cosine < 0.0 ? -to : to;
    // Not 1 - cosine, which is coarse where they are close.
    vec4 apart = near - from;
    vec2 weights = slerp_weights(vec2(1.0 - share, share), min(0.25 * dot(apart, apart), 0.5));
    return weights.x * from + weights.y * near;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= params.gaussian_count) return;
    uint gaussian = index;
    float log2_growth = 0.0;
    if (params.first_kept != ALL) {
        uint word = kept[params.first_kept + index];
        gaussian = word & ((1u << GROWTH_SHIFT) - 1u);
        log2_growth = float(word >> GROWTH_SHIFT) / GROWTH_STEPS;
    }
    PackedGaussian packed_from = states[params.first_from + gaussian];
    PackedGaussian packed_to = states[params.first_to + gaussian];
    if (never_drawn(packed_from) || never_drawn(packed_to)) {
        gaussians[index] = PackedGaussian(uvec4(0u), uvec4(0u));
        return;
    }
    PlainGaussian from = unpacked(packed_from);
    PlainGaussian to = unpacked(packed_to);
    PlainGaussian now;
    now.position = from.position + (to.position - from.position) * params.share;
    now.rotation = slerp(from.rotation, to.rotation, params.share);
    now.log2_scale = from.log2_scale + (to.log2_scale - from.log2_scale) * params.share + log2_growth;
    // As the host does (app/kernels/src/interpolate.rs). What is out of the layout's range stays so, and is not drawn.
    vec3 held = min(now.log2_scale, vec3(LOG2_MOST_SCALE));
    now.log2_scale = mix(held, now.log2_scale, greaterThanEqual(now.log2_scale, vec3(SCALE_END)));
    now.opacity = from.opacity + (to.opacity - from.opacity) * params.share;
    now.colour = from.colour + (to.colour - from.colour) * params.share;
    gaussians[index] = packed(now);
}
