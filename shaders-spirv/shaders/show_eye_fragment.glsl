// From the quads' picture, still on the chip, into a headset's images; DRAWS_DEPTH where their depth is wanted as well. Images in
// the sRGB curve encode what is written to them, the others take light as it is: either way light is written.
#include "eye.glsl"

layout(input_attachment_index = 0, set = 0, binding = 1) uniform subpassInput picture;
#ifdef DRAWS_DEPTH
layout(input_attachment_index = 1, set = 0, binding = 2) uniform subpassInput depths;
#endif

layout(location = 0) out vec4 light;

void main() {
    vec4 splatted = clamp(subpassLoad(picture), 0.0, 1.0);
    float behind_depth;
    vec4 shown = surrounded(splatted, gl_FragCoord.xy, uint(gl_ViewIndex), behind_depth);
    light = vec4(light_of(shown), shown.a);
#ifdef DRAWS_DEPTH
    gl_FragDepth = compositor_depth(subpassLoad(depths).x, splatted.a, behind_depth);
#endif
}
