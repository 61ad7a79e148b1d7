// A Gaussian as a view sees it, with everything that the derivatives need again; as tools/splat-gradient/src/projection/seen.rs, whose words
// these are. Binding 0 has the Gaussians' numbers, [14][count]: position, rotation (x, y, z, w), logarithms of the scales, logit of the opacity,
// colour.
#include "numbers.glsl"

layout(local_size_x = 64) in;

// Mirrors `camera` in src/passes.rs.
layout(push_constant) uniform Camera {
    vec4 rows[3];   // the camera's axes in the world, and the world's origin along them, metres
    vec4 lens;      // focal lengths and principal point, pixels
    vec4 slopes;    // least x/z and y/z in the Jacobian, then the greatest
    uint width, height;
    uint tiles_x;
    uint count;     // of the Gaussians
} camera;

layout(set = 0, binding = 0, std430) readonly buffer Attributes { float attributes[]; };

const float NEAR = 0.05;
const float LOW_PASS = 0.3;              // px^2
const float LOG_SCALE_END = 5.5451774;   // ln 256
const float LEAST_LENGTH_2 = 1e-24;
const float LOG2_E = 1.4426950408889634;

struct Seen {
    bool sound;            // else the rest is anything
    vec3 place;            // in the camera's axes, metres
    float inverse_depth;
    bvec2 free;            // whether x/z and y/z are taken as they are
    vec3 axis_x, axis_y;   // the camera's, each less its slope times the z axis, in the world
    vec3 image_x, image_y; // rows of J W
    vec4 rotation;         // the unit quaternion
    float inverse_length;
    mat3 own_axes;         // columns of R
    vec3 scale;
    vec3 root_x, root_y;   // rows of J W R S, pixels
    float a, b, c;         // of the covariance, widened
    float determinant;
    float opacity, transparency;
    vec3 colour;
};

float number(uint plane, uint index) { return attributes[plane * camera.count + index]; }

vec3 three(uint plane, uint index) {
    return vec3(number(plane, index), number(plane + 1u, index), number(plane + 2u, index));
}

// Held where 2^x is a normal number.
float power_of_2(float x) { return exp2(clamp(x, -126.0, 126.0)); }

mat3 columns_of(vec4 q) {
    vec3 d = q.xyz + q.xyz;
    float xx = q.x * d.x, yy = q.y * d.y, zz = q.z * d.z;
    float xy = q.x * d.y, xz = q.x * d.z, yz = q.y * d.z;
    float wx = q.w * d.x, wy = q.w * d.y, wz = q.w * d.z;
    return mat3(
        1.0 - (yy + zz), xy + wz, xz - wy,
        xy - wz, 1.0 - (xx + zz), yz + wx,
        xz + wy, yz - wx, 1.0 - (xx + yy));
}

Seen see(uint index) {
    vec3 position = three(0u, index);
    vec4 raw = vec4(three(3u, index), number(6u, index));
    vec3 log_scale = three(7u, index);
    float logit = number(10u, index);

    Seen s;
    s.colour = three(11u, index);
    s.place = vec3(dot(camera.rows[0].xyz, position), dot(camera.rows[1].xyz, position), dot(camera.rows[2].xyz, position))
        + vec3(camera.rows[0].w, camera.rows[1].w, camera.rows[2].w);
    s.inverse_depth = 1.0 / s.place.z;
    vec2 slope = s.place.xy * s.inverse_depth;
    s.free = bvec2(slope.x >= camera.slopes.x && slope.x <= camera.slopes.z, slope.y >= camera.slopes.y && slope.y <= camera.slopes.w);
    slope = clamp(slope, camera.slopes.xy, camera.slopes.zw);
    s.axis_x = camera.rows[0].xyz - slope.x * camera.rows[2].xyz;
    s.axis_y = camera.rows[1].xyz - slope.y * camera.rows[2].xyz;
    s.image_x = s.axis_x * (s.inverse_depth * camera.lens.x);
    s.image_y = s.axis_y * (s.inverse_depth * camera.lens.y);

    float length_2 = dot(raw, raw);
    s.inverse_length = 1.0 / sqrt(length_2);
    s.rotation = raw * s.inverse_length;
    s.own_axes = columns_of(s.rotation);
    s.scale = vec3(power_of_2(log_scale.x * LOG2_E), power_of_2(log_scale.y * LOG2_E), power_of_2(log_scale.z * LOG2_E));
    s.root_x = (s.image_x * s.own_axes) * s.scale;
    s.root_y = (s.image_y * s.own_axes) * s.scale;
    float a = dot(s.root_x, s.root_x);
    float c = dot(s.root_y, s.root_y);
    // Cauchy-Binet instead of a c - b b, which cancels for thin splats.
    vec3 minors = cross(s.root_x, s.root_y);
    s.determinant = dot(minors, minors) + (a + c) * LOW_PASS + LOW_PASS * LOW_PASS;
    s.a = a + LOW_PASS;
    s.b = dot(s.root_x, s.root_y);
    s.c = c + LOW_PASS;

    // The sigmoid, and its complement without cancellation.
    float against = power_of_2(logit * -LOG2_E);
    s.opacity = 1.0 / (against + 1.0);
    s.transparency = against * s.opacity;

    bool scaled = true;
    for (uint k = 0u; k < 3u; ++k) scaled = scaled && !not_a_number(log_scale[k]) && log_scale[k] < LOG_SCALE_END;
    s.sound = finite(position) && finite(length_2) && finite(s.colour) && !not_a_number(logit) && scaled
        && s.place.z > NEAR && length_2 > LEAST_LENGTH_2;
    return s;
}
