// Splats of a tile, front to back, and the pixels that they meet; as tools/splat-gradient/src/raster has it. A workgroup is a tile, an invocation
// a run of eight pixels: those of the left half from the top, then those of the right half. A pixel takes no more splats once less than OPAQUE
// shines through it, and a run none once that holds of less than STOP for all of them.
#include "numbers.glsl"

const uint RUNS = 32u; // of a tile
layout(local_size_x = 32) in;

// Mirrors `picture` in src/passes.rs.
layout(push_constant) uniform Size {
    uint width, height;
    uint tiles_x;
    uint capacity; // places in the lists
    uint count;    // Gaussians
} size;

layout(set = 0, binding = 0, std430) readonly buffer Splats { Splat splats[]; };
layout(set = 0, binding = 1, std430) readonly buffer TileStarts { uint tile_starts[]; };
layout(set = 0, binding = 2, std430) readonly buffer Pairs { uint pairs[]; };
layout(set = 0, binding = 3, std430) readonly buffer Offsets { uint offsets[]; };

const float ALPHA_MOST = 0.99;
const float LOG2_ALPHA_MOST = -0.01449957;
const float STOP = 1.0 / 255.0;
const float OPAQUE = 1e-4;

// Splats of the list that all invocations look at, and of each the runs that it may reach, one bit each.
shared Splat staged[RUNS];
shared uint reached[RUNS];
// Whether some run of the tile takes more splats.
shared uint living;

// The first pixel of the tile.
uvec2 tile_at() { return gl_WorkGroupID.xy * TILE; }

// The first pixel of this invocation's run.
uvec2 run_at() {
    uint run = gl_LocalInvocationID.x;
    return tile_at() + uvec2(run / TILE * RUN, run % TILE);
}

uint runs_of(Splat s) {
    uvec2 at = tile_at();
    uint first = max(first_of(s.rows), at.y) - at.y;
    uint last = min(last_of(s.rows) - at.y, TILE - 1u);
    uint rows = (2u << last) - (1u << first);
    uint middle = at.x + RUN;
    uint left = first_of(s.columns) < middle ? rows : 0u;
    uint right = last_of(s.columns) >= middle ? rows << TILE : 0u;
    return left | right;
}

// log2 of alpha, where it is not cut and something still shines through. Both passes compute it in the same steps, none of
// them reordered, so that both see the same splats.
float log2_alpha_at(Splat s, float dx, float dy) {
    precise float across = s.w * dy;
    precise float along = s.ux * dx + s.uy * dy;
    precise float log2_alpha = s.log2_opacity - across * across - along * along;
    return log2_alpha;
}

float alpha_of(float log2_alpha, float through) {
    bool drawn = log2_alpha >= LOG2_ALPHA_CUT && through >= OPAQUE;
    return drawn ? min(exp2(log2_alpha), ALPHA_MOST) : 0.0;
}

// What shines through a pixel before anything was blended: nothing beyond the picture's edge.
float open(uvec2 at, uint column) {
    return at.x + column < size.width && at.y < size.height ? 1.0 : 0.0;
}

// Stages as many splats of the list as there are runs, or all that are left, and returns their number.
uint stage(uint base, uint end) {
    uint lane = gl_LocalInvocationID.x;
    barrier();
    uint runs = 0u;
    if (base + lane < end) {
        Splat s = splats[pairs[base + lane]];
        staged[lane] = s;
        runs = runs_of(s);
    }
    reached[lane] = runs;
    if (lane == 0u) living = 0u;
    barrier();
    return min(RUNS, end - base);
}

// Which of the staged splats this invocation's run meets, one bit each. Each run goes through its own: where they are small, that is a few of 32.
uint met() {
    uint lane = gl_LocalInvocationID.x;
    uint splats_met = 0u;
    [[unroll]] for (uint k = 0u; k < RUNS; ++k) splats_met |= ((reached[k] >> lane) & 1u) << k;
    return splats_met;
}
