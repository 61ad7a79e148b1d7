// Which splats touch which tile, front to back: each of `lanes` invocations walks a contiguous run of the sorted splats and counts into a row of
// its own, so that there are no atomics and the order is always the same. As the renderer does it.
#include "numbers.glsl"

layout(local_size_x = 32) in;

// Mirrors `lists` in src/passes.rs.
layout(push_constant) uniform Lists {
    uint tiles_x, tiles_y;
    uint lanes;
    uint capacity; // places in the lists
    uint count;    // Gaussians
    uint emits;    // 0 where pairs are counted, 1 where they are written
} lists;

uint tile_count() { return lists.tiles_x * lists.tiles_y; }
