#version 450
#extension GL_GOOGLE_include_directive : require
#include "eye.glsl"

// Both eyes' pictures for a headset's compositor, in buffers that are copied to its images: 8 bits a channel, in the sRGB curve
// where the images are. For pictures that compute drew, and for images that cannot be drawn into.

layout(constant_id = 0) const uint GROUP = 64u;
layout(local_size_x_id = 0) in;

layout(set = 0, binding = 1, std430) readonly buffer Picture { uvec2 picture[]; };
layout(set = 0, binding = 2, std430) readonly buffer Depths { uint depths[]; };
layout(set = 0, binding = 3, std430) writeonly buffer Eye { uint pixels[]; };
layout(set = 0, binding = 4, std430) writeonly buffer EyeDepth { float eye_depths[]; };

void main() {
    uvec2 at = gl_GlobalInvocationID.xy;
    uint view = gl_GlobalInvocationID.z;
    if (at.x >= eye.width) return;
    uint index = (view * eye.height + at.y) * eye.width + at.x;
    uvec2 columns = visible_columns(view, at.y / TILE);
    if (at.x / TILE < columns.x || at.x / TILE > columns.y) {
        // Nobody sees it: all transparent, and far.
        pixels[index] = 0u;
        if (eye.depth_stride > 0u) eye_depths[index] = 1.0;
        return;
    }
    uvec2 halves = picture[index];
    vec4 splatted = clamp(vec4(unpackHalf2x16(halves.x), unpackHalf2x16(halves.y)), 0.0, 1.0);
    float behind_depth;
    vec4 shown = surrounded(splatted, vec2(at) + 0.5, view, behind_depth);
    vec3 colour = shown.rgb;
    if (eye.linear == 1u) colour = light_of(shown);
    else if (shown.a > 0.0 && shown.a < 1.0) colour = encoded(light_of(shown));
    pixels[index] = packUnorm4x8(vec4(eye.swaps_red == 1u ? colour.bgr : colour, shown.a));

    if (eye.depth_stride > 0u) {
        uint place = (view * eye.height + at.y) * eye.depth_stride + at.x;
        vec2 pair = unpackHalf2x16(depths[place / 2u]);
        float weighted = (place & 1u) == 0u ? pair.x : pair.y;
        eye_depths[index] = compositor_depth(weighted, splatted.a, behind_depth);
    }
}
