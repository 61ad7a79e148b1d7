#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_multiview : require
#include "eye.glsl"

// A rectangle for each strip of the picture, from the first column of tiles that anyone sees in it to the last. The pass cleared the rest.

const uvec2 CORNERS[6] = uvec2[](uvec2(0u), uvec2(1u, 0u), uvec2(0u, 1u), uvec2(0u, 1u), uvec2(1u, 0u), uvec2(1u));

void main() {
    uvec2 size = uvec2(eye.width, eye.height);
    uint first = uint(gl_InstanceIndex) * eye.strip_rows;
    uint end = min(first + eye.strip_rows, (size.y + TILE - 1u) / TILE);
    uvec2 columns = uvec2(size.x, 0u);
    for (uint row = first; row < end; ++row) {
        uvec2 seen = visible_columns(uint(gl_ViewIndex), row);
        if (seen.x <= seen.y) columns = uvec2(min(columns.x, seen.x), max(columns.y, seen.y));
    }
    uvec2 low = uvec2(columns.x, first) * TILE;
    // Without area where nobody sees any of it.
    uvec2 high = max(min(uvec2(columns.y + 1u, end) * TILE, size), low);
    uvec2 corner = CORNERS[gl_VertexIndex];
    vec2 at = vec2(mix(low, high, equal(corner, uvec2(1u))));
    gl_Position = vec4(2.0 * at / vec2(size) - 1.0, 0.5, 1.0);
}
