#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "raster.glsl"

// [4][height][width]: premultiplied red, green and blue, and alpha.
layout(set = 0, binding = 4, std430) writeonly buffer Picture { float picture[]; };
// [height][width]: what shines through in the end; 1 - alpha has lost most of it where that is little.
layout(set = 0, binding = 5, std430) writeonly buffer Through { float through_picture[]; };

void main() {
    // The lists did not fit and were not written; the host draws again.
    if (offsets[size.count] > size.capacity) return;
    uvec2 at = run_at();
    uint tile = gl_WorkGroupID.y * size.tiles_x + gl_WorkGroupID.x;
    uint end = tile_starts[tile + 1u];
    precise float through[RUN];
    vec3 shown[RUN];
    [[unroll]] for (uint i = 0u; i < RUN; ++i) {
        through[i] = open(at, i);
        shown[i] = vec3(0.0);
    }
    bool live = through[0] > 0.0;
    for (uint base = tile_starts[tile]; base < end; base += RUNS) {
        stage(base, end);
        uint left = met();
        while (left != 0u && live) {
            Splat s = staged[findLSB(left)];
            left &= left - 1u;
            vec3 colour = vec3(s.red, s.green, s.blue);
            precise float first = float(at.x) + 0.5 - s.mean_x;
            precise float dy = float(at.y) + 0.5 - s.mean_y;
            float most = 0.0;
            [[unroll]] for (uint i = 0u; i < RUN; ++i) {
                precise float dx = first + float(i);
                float alpha = alpha_of(log2_alpha_at(s, dx, dy), through[i]);
                precise float weight = alpha * through[i];
                through[i] = through[i] - weight;
                shown[i] += weight * colour;
                most = max(most, through[i]);
            }
            live = most >= STOP;
        }
        if (live) atomicOr(living, 1u);
        barrier();
        if (living == 0u) break;
    }
    if (at.y >= size.height) return;
    uint plane = size.width * size.height;
    [[unroll]] for (uint i = 0u; i < RUN; ++i) {
        if (at.x + i >= size.width) break;
        uint pixel = at.y * size.width + at.x + i;
        picture[pixel] = shown[i].r;
        picture[plane + pixel] = shown[i].g;
        picture[2u * plane + pixel] = shown[i].b;
        picture[3u * plane + pixel] = 1.0 - through[i];
        through_picture[pixel] = through[i];
    }
}
