#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_multiview : require
#include "frame.glsl"

// The quad back end: six corners for each sorted Gaussian, farthest first. The corners are the image, under the splat's own root, of a
// hexagon around the circle where its alpha is cut, so no eigenvectors are needed. A quad would have 15 % more fragments, and what is
// between it and the ellipse is shaded and blended for nothing.

layout(constant_id = 0) const uint QUADS_PER_INSTANCE = 1u;

layout(set = 0, binding = 1, std430) readonly buffer Splats0 { Splat splats_0[]; };
layout(set = 0, binding = 2, std430) readonly buffer Splats1 { Splat splats_1[]; };
layout(set = 0, binding = 3, std430) readonly buffer Rects { uint rects[]; };
layout(set = 0, binding = 4, std430) readonly buffer Order { uint order[]; };
#define STATE_BINDING 5
#define STATE_ACCESS readonly
#include "state.glsl"

const uint CORNERS = 6u;
// Around the unit circle, and the corners of a square of which two triangles have no area.
const vec2 HEXAGON[CORNERS] = vec2[](vec2(1.1547006, 0.0), vec2(0.5773503, 1.0), vec2(-0.5773503, 1.0),
                                     vec2(-1.1547006, 0.0), vec2(-0.5773503, -1.0), vec2(0.5773503, -1.0));
const vec2 SQUARE[CORNERS] = vec2[](vec2(0.0), vec2(0.0), vec2(1.0, 0.0), vec2(1.0), vec2(0.0, 1.0), vec2(0.0));

layout(location = 0) noperspective out vec2 offset; // alpha = exp2(log2_opacity - dot(offset, offset))
layout(location = 1) flat out vec4 colour_depth;
layout(location = 2) flat out float log2_opacity;

void main() {
    uint place = uint(gl_InstanceIndex) * QUADS_PER_INSTANCE + uint(gl_VertexIndex) / CORNERS;
    // Outside of every picture: the primitive is culled.
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    offset = vec2(0.0);
    colour_depth = vec4(0.0);
    log2_opacity = 0.0;
    if (place >= state.count || state.refused != 0u) return;
    uint index = order[state.count - 1u - place];
    uint view = uint(gl_ViewIndex);
    if (rects[view * frame.total_count + index] == EMPTY_RECT) return;
    Splat s;
    if (view == 0u) s = splats_0[index];
    else s = splats_1[index];
    uint corner = uint(gl_VertexIndex) % CORNERS;
    float reach = sqrt(max(s.log2_opacity - LOG2_ALPHA_CUT, 0.0));
    vec2 mean = vec2(s.mean_x, s.mean_y);
    vec2 size = vec2(frame.width, frame.height);
    vec2 half_box = reach * vec2(length(vec2(1.0, s.uy / s.wy)) / s.ux, 1.0 / s.wy);
    vec2 from_mean;
    if (any(lessThan(mean, half_box)) || any(greaterThan(mean + half_box, size))) {
        // Over the picture's edge: the splat's box, cut to the picture, so that nothing is left to clip. Mesa's clipper
        // gets one triangle's offsets wrong, and over a quad of 100,000 pixels no interpolation is exact.
        from_mean = mix(max(-half_box, -mean), min(half_box, size - mean), SQUARE[corner]);
        offset = vec2(s.ux * from_mean.x + s.uy * from_mean.y, s.wy * from_mean.y);
    } else {
        offset = HEXAGON[corner] * reach;
        from_mean.y = offset.y / s.wy;
        from_mean.x = (offset.x - s.uy * from_mean.y) / s.ux;
    }
    gl_Position = vec4(2.0 * (mean + from_mean) / size - 1.0, 0.5, 1.0);
    colour_depth = vec4(unpackHalf2x16(s.red_green), unpackHalf2x16(s.blue_depth));
    log2_opacity = s.log2_opacity;
}
