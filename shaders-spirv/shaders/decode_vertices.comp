#version 450
#extension GL_GOOGLE_include_directive : require
#include "numbers.glsl"

// A mesh before skinning, from a code: its rest shape and a weighted sum of fields over its vertices' coordinates, each stored as a
// byte times its coordinate's scale. One invocation for four coordinates.

layout(constant_id = 0) const uint GROUP = 64u;
layout(local_size_x_id = 0) in;

layout(push_constant) uniform Params {
    uint fours;        // of coordinates
    uint fields;
    uint first_output; // where the coordinates go, in fours
    float unit;        // metres a step of a scale
} params;

layout(set = 0, binding = 0, std430) readonly buffer Fields { uint values[]; };   // [fields, fours], four signed bytes each
layout(set = 0, binding = 1, std430) readonly buffer Scales { uvec2 scales[]; };  // [fours], four halves each
layout(set = 0, binding = 2, std430) readonly buffer Rest { vec4 rest[]; };       // [fours], metres
layout(set = 0, binding = 3, std430) readonly buffer Code { float code[]; };      // [fields]
layout(set = 0, binding = 4, std430) writeonly buffer Vertices { vec4 vertices[]; };

void main() {
    uint at = gl_GlobalInvocationID.x;
    if (at >= params.fours) return;
    vec4 sum = vec4(0.0);
    // Four at a time, whose reads are under way together.
    uint field = 0u, word = at;
    for (; field + 4u <= params.fields; field += 4u) {
        uvec4 words = uvec4(values[word], values[word + params.fours], values[word + 2u * params.fours], values[word + 3u * params.fours]);
        sum += code[field] * signed_bytes(words.x) + code[field + 1u] * signed_bytes(words.y)
             + code[field + 2u] * signed_bytes(words.z) + code[field + 3u] * signed_bytes(words.w);
        word += 4u * params.fours;
    }
    for (; field < params.fields; ++field) {
        sum += code[field] * signed_bytes(values[word]);
        word += params.fours;
    }
    vec4 scale = vec4(unpackHalf2x16(scales[at].x), unpackHalf2x16(scales[at].y));
    vertices[params.first_output + at] = rest[at] + params.unit * scale * sum;
}
