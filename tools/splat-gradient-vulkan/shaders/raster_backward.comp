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

const uint BATCH = 8u;
// Sums of each run, by splat and moment; a row is one longer than there are runs, so that neighbours read and write other banks.
const uint ROW = RUNS + 1u;
shared float parts[BATCH * MOMENTS * ROW];

// Of the splat's runs, in their order.
float sum_of(uint column, uvec2 tile_at) {
    Splat s = staged[column / MOMENTS];
    uint first = max(first_of(s.rows), tile_at.y) - tile_at.y;
    uint last = min(last_of(s.rows) - tile_at.y, TILE - 1u);
    float sum = 0.0;
    for (uint half_tile = 0u; half_tile < 2u; ++half_tile) {
        if (!reaches(s, tile_at + uvec2(half_tile * RUN, first))) continue;
        for (uint row = first; row <= last; ++row) sum += parts[column * ROW + half_tile * TILE + row];
    }
    return sum;
}

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
        uint count = stage(base, end, BATCH);
        for (uint k = 0u; k < count; ++k) {
            Splat s = staged[k];
            if (!reaches(s, at)) continue;
            float h0 = 0.0, h1 = 0.0, h2 = 0.0;
            vec3 by_splat = vec3(0.0);
            float dy = float(at.y) + 0.5 - s.mean_y;
            if (live) {
                vec3 colour = vec3(s.red, s.green, s.blue);
                float left = float(at.x) + 0.5 - s.mean_x;
                float most = 0.0;
                [[unroll]] for (uint i = 0u; i < RUN; ++i) {
                    float dx = left + float(i);
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
            [[unroll]] for (uint m = 0u; m < MOMENTS; ++m) parts[(k * MOMENTS + m) * ROW + lane] = gathered[m];
        }
        if (live) atomicOr(living, 1u);
        barrier();
        for (uint column = lane; column < count * MOMENTS; column += RUNS) {
            moments[base * MOMENTS + column] = sum_of(column, gl_WorkGroupID.xy * TILE);
        }
        base += count;
        if (living == 0u) break;
    }
    // What is hidden gathers nothing.
    for (uint place = base * MOMENTS + lane; place < end * MOMENTS; place += RUNS) moments[place] = 0.0;
}
