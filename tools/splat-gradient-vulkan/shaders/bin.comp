#version 450
#extension GL_GOOGLE_include_directive : require
#include "lists.glsl"

// Counts pairs of tile and splat, and in a second dispatch writes them: one shader for both, so that both find the same pairs.

layout(set = 0, binding = 0, std430) readonly buffer Order { uint order[]; };
layout(set = 0, binding = 1, std430) readonly buffer State { uint drawn; };
layout(set = 0, binding = 2, std430) readonly buffer Splats { Splat splats[]; };
// [lane][tile]: first the lane's splats on the tile, then where its next one goes in the tile's list.
layout(set = 0, binding = 3, std430) buffer Table { uint table[]; };
// Where each tile's list begins, and at the end where the last one ends.
layout(set = 0, binding = 4, std430) readonly buffer TileStarts { uint tile_starts[]; };
// By Gaussian: where its places begin.
layout(set = 0, binding = 5, std430) readonly buffer Offsets { uint offsets[]; };
// Tile by tile, front to back: which Gaussian.
layout(set = 0, binding = 6, std430) writeonly buffer Pairs { uint pairs[]; };
// Gaussian by Gaussian, tile by tile of its rectangle: where the pair is, or NONE.
layout(set = 0, binding = 7, std430) writeonly buffer Places { uint places[]; };

float square(float x) { return x * x; }

// Whether alpha reaches the cut at some pixel centre's height and width of the tile. Never no where it does.
bool touches(Splat s, uvec2 tile) {
    float side = float(TILE - 1u);
    vec2 near = vec2(tile * TILE) + 0.5 - vec2(s.mean_x, s.mean_y);
    vec2 far = near + side;
    if (near.x <= 0.0 && far.x >= 0.0 && near.y <= 0.0 && far.y >= 0.0) return true;
    // The quadratic is convex: its least lies on a side that faces the mean.
    float least = 3.4e38;
    if (near.x > 0.0 || far.x < 0.0) {
        float x = near.x > 0.0 ? near.x : far.x;
        float y = clamp(-s.ux * s.uy * x / (s.uy * s.uy + s.w * s.w), near.y, far.y);
        least = square(s.ux * x + s.uy * y) + square(s.w * y);
    }
    if (near.y > 0.0 || far.y < 0.0) {
        float y = near.y > 0.0 ? near.y : far.y;
        float x = clamp(-s.uy * y / s.ux, near.x, far.x);
        least = min(least, square(s.ux * x + s.uy * y) + square(s.w * y));
    }
    return s.log2_opacity - least > LOG2_ALPHA_CUT - ALPHA_CUT_SLACK;
}

void main() {
    uint lane = gl_GlobalInvocationID.x;
    if (lane >= lists.lanes) return;
    bool emits = lists.emits != 0u;
    // Too many for the lists: the host reads this total too, makes room and draws again. Nor are they counted: that may take longer than a driver waits.
    if (offsets[lists.count] > lists.capacity) return;
    uint row = lane * tile_count();
    uint per_lane = (drawn + lists.lanes - 1u) / lists.lanes;
    uint start = min(lane * per_lane, drawn);
    uint end = min(start + per_lane, drawn);
    for (uint rank = start; rank < end; ++rank) {
        uint index = order[rank];
        Splat s = splats[index];
        uvec2 low = uvec2(first_of(s.columns), first_of(s.rows)) / TILE;
        uvec2 high = uvec2(last_of(s.columns), last_of(s.rows)) / TILE;
        uint place = emits ? offsets[index] : 0u;
        for (uint y = low.y; y <= high.y; ++y) {
            for (uint x = low.x; x <= high.x; ++x) {
                uint tile = y * lists.tiles_x + x;
                uint pair = NONE;
                // A small one meets the only tile it may reach.
                if (low == high || touches(s, uvec2(x, y))) {
                    uint next = table[row + tile];
                    table[row + tile] = next + 1u;
                    if (emits) {
                        pair = tile_starts[tile] + next;
                        pairs[pair] = index;
                    }
                }
                if (emits) places[place++] = pair;
            }
        }
    }
}
