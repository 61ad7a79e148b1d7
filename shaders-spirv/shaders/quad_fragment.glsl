// The quad back end's fragments; DRAWS_DEPTH where there is a depth picture to draw as well.
#include "frame.glsl"

layout(location = 0) noperspective in vec2 offset;
layout(location = 1) flat in vec4 colour_depth;
layout(location = 2) flat in float log2_opacity;

layout(location = 0) out vec4 picture; // premultiplied
#ifdef DRAWS_DEPTH
layout(location = 1) out vec4 depth_picture; // depth times alpha in the first channel, and the alpha it is blended by
#endif

void main() {
    float log2_alpha = log2_opacity - dot(offset, offset);
    if (log2_alpha < LOG2_ALPHA_CUT) discard;
    float alpha = min(exp2(log2_alpha), ALPHA_MOST);
    picture = vec4(alpha * colour_depth.rgb, alpha);
#ifdef DRAWS_DEPTH
    depth_picture = vec4(alpha * colour_depth.a, 0.0, 0.0, alpha);
#endif
}
