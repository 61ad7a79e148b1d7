#version 450

// A premultiplied picture over a vertical gradient, fitted into another size and packed to 8 bits a channel.

layout(constant_id = 0) const uint GROUP = 64u;
layout(local_size_x_id = 0) in;

layout(push_constant) uniform ComposeParams {
    vec4 top;             // display colour of the first row
    vec4 bottom;          // and of the last
    uvec2 picture_size;
    uvec2 window_size;
    uint first_pixel;     // where the view starts in the picture buffer
    uint blue_first;      // 1 for BGRA, 0 for RGBA
} params;

layout(set = 0, binding = 0, std430) readonly buffer Picture { uvec2 picture[]; };
layout(set = 0, binding = 1, std430) writeonly buffer Window { uint window[]; };

vec4 texel(ivec2 at) {
    if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, ivec2(params.picture_size)))) return vec4(0.0);
    uvec2 halves = picture[params.first_pixel + uint(at.y) * params.picture_size.x + uint(at.x)];
    return vec4(unpackHalf2x16(halves.x), unpackHalf2x16(halves.y));
}

void main() {
    uvec2 at = gl_GlobalInvocationID.xy;
    if (at.x >= params.window_size.x) return;
    // The whole picture as large as it fits, in the middle.
    vec2 ratio = vec2(params.window_size) / vec2(params.picture_size);
    float scale = min(ratio.x, ratio.y);
    vec2 source = (vec2(at) + 0.5 - 0.5 * vec2(params.window_size)) / scale + 0.5 * vec2(params.picture_size) - 0.5;
    ivec2 corner = ivec2(floor(source));
    vec2 share = source - vec2(corner);
    vec4 front = mix(
        mix(texel(corner), texel(corner + ivec2(1, 0)), share.x),
        mix(texel(corner + ivec2(0, 1)), texel(corner + ivec2(1, 1)), share.x), share.y);
    vec3 back = mix(params.top.rgb, params.bottom.rgb, float(at.y) / float(max(params.window_size.y - 1u, 1u)));
    vec3 colour = front.rgb + (1.0 - front.a) * back;
    window[at.y * params.window_size.x + at.x] = packUnorm4x8(vec4(params.blue_first == 1u ? colour.bgr : colour.rgb, 1.0));
}
