#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "raster.glsl"

// What the derivatives by a tile's pixels say of its splats. With g the derivatives by red, green, blue and alpha of a pixel, T the transmittance
// before splat i and c its colour: dL/dalpha_i = T (c_i . g) - (sum of what lies behind . g - g_alpha T_end) / (1 - alpha_i). Each pair of tile and
// splat has a place of its own for what it gathers: no atomics, and sums always in one order.

layout(set = 0, binding = 4, std430) readonly buffer Picture { float picture[]; };
layout(set = 0, binding = 5, std430) readonly buffer Through { float through_picture[]; };
// [4][height][width]: derivatives of the loss.
layout(set = 0, binding = 6, std430) readonly buffer ByPixel { float by_pixel[]; };
// [pair][MOMENTS].
layout(set = 0, binding = 7, std430) writeonly buffer Moments { float moments[]; };

// What a run gathers of a splat that it meets, splat by splat, run by run; there is room for so many.
const uint ROOM = 256u;
shared float parts[ROOM * MOMENTS];
// Where each staged splat's begin, and how many of the staged ones have room.
shared uint starts[RUNS];
shared uint taken;

void main() {
    uvec2 at = run_at();
    uint lane = gl_LocalInvocationID.x;
    uint tile = gl_WorkGroupID.y * size.tiles_x + gl_WorkGroupID.x;
    uint end = tile_starts[tile + 1u];
    uint plane = size.width * size.height;
    precise float through[RUN];
    float behind[RUN];
    vec3 by_colour[RUN];
    [[unroll]] for (uint i = 0u; i < RUN; ++i) {
        through[i] = open(at, i);
        behind[i] = 0.0;
        by_colour[i] = vec3(0.0);
        if (through[i] > 0.0) {
            uint pixel = at.y * size.width + at.x + i;
            by_colour[i] = vec3(by_pixel[pixel], by_pixel[plane + pixel], by_pixel[2u * plane + pixel]);
            vec3 shown = vec3(picture[pixel], picture[plane + pixel], picture[2u * plane + pixel]);
            behind[i] = dot(shown, by_colour[i]) - through_picture[pixel] * by_pixel[3u * plane + pixel];
        }
    }
    bool live = through[0] > 0.0;
    uint base = tile_starts[tile];
    while (base < end) {
        uint staged_count = stage(base, end);
        uint start = 0u;
        for (uint k = 0u; k < lane; ++k) start += uint(bitCount(reached[k]));
        starts[lane] = start;
        if (lane == 0u) taken = staged_count;
        barrier();
        if (start + uint(bitCount(reached[lane])) > ROOM) atomicMin(taken, lane);
        barrier();
        uint count = taken;
        uint left = met();
        if (count < RUNS) left &= (1u << count) - 1u;
        while (left != 0u) {
            uint k = uint(findLSB(left));
            left &= left - 1u;
            Splat s = staged[k];
            float h0 = 0.0, h1 = 0.0, h2 = 0.0;
            vec3 by_splat = vec3(0.0);
            precise float dy = float(at.y) + 0.5 - s.mean_y;
            if (live) {
                vec3 colour = vec3(s.red, s.green, s.blue);
                precise float first = float(at.x) + 0.5 - s.mean_x;
                float most = 0.0;
                [[unroll]] for (uint i = 0u; i < RUN; ++i) {
                    precise float dx = first + float(i);
                    float log2_alpha = log2_alpha_at(s, dx, dy);
                    float alpha = alpha_of(log2_alpha, through[i]);
                    precise float weight = alpha * through[i];
                    through[i] = through[i] - weight;
                    by_splat += weight * by_colour[i];
                    float shown = weight * dot(colour, by_colour[i]);
                    float rest = behind[i] - shown;
                    // By the logarithm of alpha; nothing where it is held at its most.
                    float h = log2_alpha < LOG2_ALPHA_MOST ? shown - rest * alpha / (1.0 - alpha) : 0.0;
                    h0 += h;
                    h1 += h * dx;
                    h2 += h * dx * dx;
                    behind[i] = rest;
                    most = max(most, through[i]);
                }
                live = most >= STOP;
            }
            float gathered[MOMENTS] = float[](h0, h1, h2, h0 * dy, h1 * dy, h0 * dy * dy, by_splat.r, by_splat.g, by_splat.b);
            uint part = starts[k] + uint(bitCount(reached[k] & ((1u << lane) - 1u)));
            [[unroll]] for (uint m = 0u; m < MOMENTS; ++m) parts[part * MOMENTS + m] = gathered[m];
        }
        if (live) atomicOr(living, 1u);
        barrier();
        for (uint column = lane; column < count * MOMENTS; column += RUNS) {
            uint k = column / MOMENTS, m = column % MOMENTS;
            uint from = starts[k], to = from + uint(bitCount(reached[k]));
            float sum = 0.0;
            for (uint part = from; part < to; ++part) sum += parts[part * MOMENTS + m];
            moments[base * MOMENTS + column] = sum;
        }
        base += count;
        if (living == 0u) break;
    }
    // What is hidden gathers nothing.
    for (uint place = base * MOMENTS + lane; place < end * MOMENTS; place += RUNS) moments[place] = 0.0;
}
