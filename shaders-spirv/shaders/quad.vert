#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_multiview : require
#include "frame.glsl"

// The quad back end: four corners for each sorted Gaussian, farthest first. The corners are the image of a square
// under the splat's own root, so the quad is exactly as large as its axes' bounding box and needs no eigenvectors.

layout(constant_id = 0) const uint QUADS_PER_INSTANCE = 1u;

layout(set = 0, binding = 1, std430) readonly buffer Splats0 { Splat splats_0[]; };
layout(set = 0, binding = 2, std430) readonly buffer Splats1 { Splat splats_1[]; };
layout(set = 0, binding = 3, std430) readonly buffer Rects { uint rects[]; };
layout(set = 0, binding = 4, std430) readonly buffer Order { uint order[]; };
#define STATE_BINDING 5
#define STATE_ACCESS readonly
#include "state.glsl"

layout(location = 0) noperspective out vec2 offset; // alpha = exp2(log2_opacity - dot(offset, offset))
layout(location = 1) flat out vec4 colour_depth;
layout(location = 2) flat out float log2_opacity;

void main() {
    uint place = uint(gl_InstanceIndex) * QUADS_PER_INSTANCE + uint(gl_VertexIndex) / 4u;
    // Outside of every picture: the primitive is culled.
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    offset = vec2(0.0);
    colour_depth = vec4(0.0);
    log2_opacity = 0.0;
    if (place >= state.count) return;
    uint index = order[state.count - 1u - place];
    uint view = uint(gl_ViewIndex);
    if (rects[view * frame.total_count + index] == EMPTY_RECT) return;
    Splat s;
    if (view == 0u) s = splats_0[index];
    else s = splats_1[index];
    vec2 corner = vec2((gl_VertexIndex & 1) == 0 ? -1.0 : 1.0, (gl_VertexIndex & 2) == 0 ? -1.0 : 1.0);
    offset = corner * sqrt(max(s.log2_opacity - LOG2_ALPHA_CUT, 0.0));
    float dy = offset.y / s.wy;
    float dx = (offset.x - s.uy * dy) / s.ux;
    vec2 pixel = vec2(s.mean_x + dx, s.mean_y + dy);
    gl_Position = vec4(2.0 * pixel / vec2(frame.width, frame.height) - 1.0, 0.5, 1.0);
    colour_depth = vec4(unpackHalf2x16(s.red_green), unpackHalf2x16(s.blue_depth));
    log2_opacity = s.log2_opacity;
}
