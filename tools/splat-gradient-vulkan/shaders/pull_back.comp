#version 450
#extension GL_GOOGLE_include_directive : require
#include "seen.glsl"

// From the moments of splats to the derivatives by the attributes and by the camera's motion; as
// tools/splat-gradient/src/projection/derivatives.rs, which has the formulas' words.

// By Gaussian, and one more: where its places begin.
layout(set = 0, binding = 1, std430) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 2, std430) readonly buffer Places { uint places[]; };
layout(set = 0, binding = 3, std430) readonly buffer Moments { float moments[]; };
// [14][count].
layout(set = 0, binding = 4, std430) writeonly buffer Derivatives { float derivatives[]; };
// [workgroup][6]: by the camera's shift and rotation.
layout(set = 0, binding = 5, std430) writeonly buffer Motions { float motions[]; };

const uint GROUP = 64u;
const uint ATTRIBUTES = 14u;
shared float parts[6u * GROUP];

// R S v: the derivative by a row of J W, of that by the row's product with R S.
vec3 along_own(Seen s, vec3 row) { return s.own_axes * (row * s.scale); }

void pull_back(uint index, float sums[MOMENTS], out float by[ATTRIBUTES], out vec3 by_shift, out vec3 by_rotation) {
    Seen s = see(index);
    float inverse = 1.0 / s.determinant;
    // Q = [[a, b], [b, c]]^-1.
    float qa = s.c * inverse, qb = -s.b * inverse, qc = s.a * inverse;
    float hx = sums[1], hxx = sums[2], hy = sums[3], hxy = sums[4], hyy = sums[5];
    vec2 by_mean = vec2(qa * hx + qb * hy, qb * hx + qc * hy);
    // Q M Q: the derivative by the covariance, twice.
    float n00 = qa * hxx + qb * hxy, n01 = qa * hxy + qb * hyy;
    float n10 = qb * hxx + qc * hxy, n11 = qb * hxy + qc * hyy;
    float by_a = n00 * qa + n01 * qb, by_b = n00 * qb + n01 * qc, by_c = n10 * qb + n11 * qc;

    // covariance = root root^T.
    vec3 by_root_x = s.root_x * by_a + s.root_y * by_b;
    vec3 by_root_y = s.root_x * by_b + s.root_y * by_c;
    vec3 by_log_scale = by_root_x * s.root_x + by_root_y * s.root_y;
    // root = image_from_world R S.
    vec3 by_image_x = along_own(s, by_root_x);
    vec3 by_image_y = along_own(s, by_root_y);
    vec3 by_turn = cross(by_image_x, s.image_x) + cross(by_image_y, s.image_y);

    // image_from_world = focal / z (axis - slope z_axis), mean = focal place / z + centre.
    vec3 depth_axis = camera.rows[2].xyz;
    vec2 along = vec2(dot(by_image_x, s.axis_x), dot(by_image_y, s.axis_y));
    vec2 by_slope = vec2(dot(by_image_x, depth_axis), dot(by_image_y, depth_axis)) * -s.inverse_depth;
    by_slope = mix(vec2(0.0), by_slope, s.free);
    vec2 by_ratio = (by_mean + by_slope) * camera.lens.xy;
    float by_inverse_depth = dot(along, camera.lens.xy) + dot(by_ratio, s.place.xy);
    vec3 by_place = vec3(by_ratio * s.inverse_depth, -by_inverse_depth * s.inverse_depth * s.inverse_depth);
    vec3 by_position = by_place.x * camera.rows[0].xyz + by_place.y * camera.rows[1].xyz + by_place.z * camera.rows[2].xyz;
    // A unit quaternion q changes by (turn / 2, 0) q.
    float twice = s.inverse_length * 2.0;
    vec3 by_imaginary = (by_turn * s.rotation.w + cross(by_turn, s.rotation.xyz)) * twice;
    float by_real = -dot(by_turn, s.rotation.xyz) * twice;

    for (uint k = 0u; k < 3u; ++k) {
        by[k] = by_position[k];
        by[3u + k] = by_imaginary[k];
        by[7u + k] = by_log_scale[k];
        // None where a colour is held at 0.
        by[11u + k] = s.colour[k] > 0.0 ? sums[6u + k] : 0.0;
    }
    by[6] = by_real;
    by[10] = sums[0] * s.transparency;
    // Turning what the camera sees moves every place and turns every Gaussian.
    by_shift = by_place;
    by_rotation = cross(s.place, by_place)
        + vec3(dot(by_turn, camera.rows[0].xyz), dot(by_turn, camera.rows[1].xyz), dot(by_turn, camera.rows[2].xyz));
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    uint lane = gl_LocalInvocationID.x;
    float by[ATTRIBUTES];
    for (uint k = 0u; k < ATTRIBUTES; ++k) by[k] = 0.0;
    vec3 by_shift = vec3(0.0), by_rotation = vec3(0.0);
    if (index < camera.count) {
        uint start = offsets[index], end = offsets[index + 1u];
        if (start < end) {
            float sums[MOMENTS];
            for (uint m = 0u; m < MOMENTS; ++m) sums[m] = 0.0;
            for (uint at = start; at < end; ++at) {
                uint pair = places[at];
                if (pair == NONE) continue;
                for (uint m = 0u; m < MOMENTS; ++m) sums[m] += moments[pair * MOMENTS + m];
            }
            pull_back(index, sums, by, by_shift, by_rotation);
        }
        for (uint k = 0u; k < ATTRIBUTES; ++k) derivatives[k * camera.count + index] = by[k];
    }
    for (uint k = 0u; k < 3u; ++k) {
        parts[k * GROUP + lane] = by_shift[k];
        parts[(3u + k) * GROUP + lane] = by_rotation[k];
    }
    barrier();
    if (lane < 6u) {
        float sum = 0.0;
        for (uint part = 0u; part < GROUP; ++part) sum += parts[lane * GROUP + part];
        motions[gl_WorkGroupID.x * 6u + lane] = sum;
    }
}
