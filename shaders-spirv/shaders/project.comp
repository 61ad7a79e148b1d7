#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "frame.glsl"

// One invocation per Gaussian: cull, EWA projection into each view, depth from the head centre.
// Formulas: Zwicker et al., "EWA Splatting" (2001); Kerbl et al., "3D Gaussian Splatting" (2023), whose
// public code sets the 0.3 px^2 low-pass and the 1.3 tan(fov) limit of the Jacobian.

layout(constant_id = 0) const uint GROUP = 64u;
layout(local_size_x_id = 0) in;

struct PackedGaussian {
    vec4 position_opacity;
    vec4 rotation;
    vec4 scale;
    vec4 colour;
};

layout(set = 0, binding = 1, std430) readonly buffer Gaussians { PackedGaussian gaussians[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Splats { Splat splats[]; };
layout(set = 0, binding = 3, std430) writeonly buffer Rects { uint rects[]; };
layout(set = 0, binding = 4, std430) writeonly buffer Depths { uint depths[]; };
layout(set = 0, binding = 5, std430) buffer DepthRange { uint least; uint greatest; } depth_range;

const float LOW_PASS = 0.3;                       // px^2
const float SQRT_HALF_LOG2_E = 0.8493218002880191; // sqrt(log2(e) / 2)
const float LN_2 = 0.6931471805599453;

// Columns: the Gaussian's axes in the world, each as long as its standard deviation.
mat3 scaled_axes(vec4 q, vec3 scale) {
    vec3 x = vec3(1.0 - 2.0 * (q.y * q.y + q.z * q.z), 2.0 * (q.x * q.y + q.w * q.z), 2.0 * (q.x * q.z - q.w * q.y));
    vec3 y = vec3(2.0 * (q.x * q.y - q.w * q.z), 1.0 - 2.0 * (q.x * q.x + q.z * q.z), 2.0 * (q.y * q.z + q.w * q.x));
    vec3 z = vec3(2.0 * (q.x * q.z + q.w * q.y), 2.0 * (q.y * q.z - q.w * q.x), 1.0 - 2.0 * (q.x * q.x + q.y * q.y));
    return mat3(x * scale.x, y * scale.y, z * scale.z);
}

// Writes the splat of one view and returns the tiles it may touch, or EMPTY_RECT.
uint project(uint view, uint index, vec3 position, float opacity, mat3 axes, vec3 colour) {
    ViewParams v = frame.views[view];
    vec4 p = vec4(position, 1.0);
    vec3 t = vec3(dot(v.image_from_world[0], p), dot(v.image_from_world[1], p), dot(v.image_from_world[2], p));
    if (!(t.z > v.clip.x)) return EMPTY_RECT;

    float inv_z = 1.0 / t.z;
    float slope_x = clamp(t.x * inv_z, v.slope_limits.x, v.slope_limits.y);
    float slope_y = clamp(t.y * inv_z, v.slope_limits.z, v.slope_limits.w);
    vec3 view_z = v.image_from_world[2].xyz;
    // Rows of J * W, then of J * W * axes: the 2x3 root of the image covariance.
    vec3 jw_x = v.intrinsics.x * inv_z * (v.image_from_world[0].xyz - slope_x * view_z);
    vec3 jw_y = v.intrinsics.y * inv_z * (v.image_from_world[1].xyz - slope_y * view_z);
    vec3 root_x = jw_x * axes;
    vec3 root_y = jw_y * axes;
    float a0 = dot(root_x, root_x);
    float c0 = dot(root_y, root_y);
    float a = a0 + LOW_PASS;
    float b = dot(root_x, root_y);
    float c = c0 + LOW_PASS;
    // Cauchy-Binet instead of a*c - b*b, which cancels for thin splats.
    vec3 minors = cross(root_x, root_y);
    float det = dot(minors, minors) + LOW_PASS * (a0 + c0) + LOW_PASS * LOW_PASS;

    float log2_opacity = log2(opacity);
    vec2 mean = v.intrinsics.xy * t.xy * inv_z + v.intrinsics.zw;
    float q_cut = 2.0 * LN_2 * (log2_opacity - LOG2_ALPHA_CUT);
    vec2 reach = sqrt(q_cut * vec2(a, c));
    if (!finite(vec4(mean, reach)) || !finite(c * det)) return EMPTY_RECT;

    vec2 low = mean - reach;
    vec2 high = mean + reach;
    vec2 size = vec2(frame.width, frame.height);
    if (any(lessThan(high, vec2(0.0))) || any(greaterThan(low, size))) return EMPTY_RECT;
    vec2 last_tile = vec2(frame.tiles_x - 1u, frame.tiles_y - 1u);
    uvec2 first = uvec2(clamp(floor(low / float(TILE)), vec2(0.0), last_tile));
    uvec2 last = uvec2(clamp(floor(high / float(TILE)), vec2(0.0), last_tile));

    float inv_root = SQRT_HALF_LOG2_E * inversesqrt(c * det);
    Splat s;
    s.mean_x = mean.x;
    s.mean_y = mean.y;
    s.ux = inv_root * c;
    s.uy = -inv_root * b;
    s.wy = SQRT_HALF_LOG2_E * inversesqrt(c);
    s.log2_opacity = log2_opacity;
    s.red_green = packHalf2x16(colour.rg);
    s.blue = packHalf2x16(vec2(colour.b, 0.0));
    splats[view * frame.gaussian_count + index] = s;
    return first.x | (first.y << 8) | (last.x << 16) | (last.y << 24);
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    uint depth = DROPPED;
    if (index < frame.gaussian_count) {
        PackedGaussian g = gaussians[index];
        float opacity = g.position_opacity.w;
        bool usable = finite(g.position_opacity) && finite(g.rotation) && finite(g.scale.xyz)
            && finite(g.colour.rgb) && opacity > 1.0 / 255.0;
        uint rect_0 = EMPTY_RECT;
        uint rect_1 = EMPTY_RECT;
        if (usable) {
            mat3 axes = scaled_axes(g.rotation, g.scale.xyz);
            // Largest half; more is no colour but would become infinite in the packed splat.
            vec3 colour = clamp(g.colour.rgb, vec3(0.0), vec3(65504.0));
            vec3 position = g.position_opacity.xyz;
            rect_0 = project(0u, index, position, opacity, axes, colour);
            if (frame.view_count > 1u) rect_1 = project(1u, index, position, opacity, axes, colour);
            if (rect_0 != EMPTY_RECT || rect_1 != EMPTY_RECT) {
                float metres = dot(frame.depth_plane.xyz, position) + frame.depth_plane.w;
                // The bits of a positive float rise with it: an exact integer key. Converging eyes
                // may see a point behind the head plane: nearest of all.
                depth = metres > 0.0 ? floatBitsToUint(metres) : 0u;
            }
        }
        rects[index] = rect_0;
        if (frame.view_count > 1u) rects[frame.gaussian_count + index] = rect_1;
        depths[index] = depth;
    }
    uint least = subgroupMin(depth);
    uint greatest = subgroupMax(depth == DROPPED ? 0u : depth);
    if (subgroupElect() && least != DROPPED) {
        atomicMin(depth_range.least, least);
        atomicMax(depth_range.greatest, greatest);
    }
}
