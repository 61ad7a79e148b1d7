// A workgroup is one subgroup and owns one block of a 16x16 tile, 8x8 pixels, 16x8 where a subgroup is 128 wide; or all blocks of a
// tile, one after the other. Each lane tests one listed splat against a block; those that touch it are handed round and blended front to
// back until the whole block lets less than TRANSMITTANCE_CUT through.
#include "frame.glsl"

layout(constant_id = 0) const uint SUBGROUP = 8u; // invocations of one subgroup: 4, 8, ... 128
layout(constant_id = 1) const bool DEPTH = true; // whether the depth picture is drawn
layout(local_size_x_id = 0) in;

layout(set = 0, binding = 1, std430) readonly buffer Splats0 { Splat splats_0[]; };
layout(set = 0, binding = 2, std430) readonly buffer Splats1 { Splat splats_1[]; };
layout(set = 0, binding = 3, std430) readonly buffer TileStarts { uint tile_starts[]; };
layout(set = 0, binding = 4, std430) readonly buffer Pairs { uint pairs[]; };
// [view][row][column] as four halves: premultiplied red, green, blue, alpha. A buffer, not an image: Mesa 25's
// llvmpipe loses stores to images of 64-bit pixels in some of a wide subgroup's lanes, and is slow at the rest.
layout(set = 0, binding = 5, std430) writeonly buffer Picture { uvec2 picture[]; };
// [view][row][pair of columns] as two halves: sum of depth times the same weights as the colours', metres.
layout(set = 0, binding = 6, std430) writeonly buffer DepthPicture { uint depth_picture[]; };

const uint BLOCK_WIDTH = SUBGROUP > 64u ? 16u : 8u;
const uint BLOCK_HEIGHT = 8u;
// A lane's pixels: in each of its columns some rows, evenly apart.
const uint COLUMNS = SUBGROUP < BLOCK_WIDTH ? BLOCK_WIDTH / SUBGROUP : 1u;
const uint ROW_STEP = SUBGROUP > BLOCK_WIDTH ? SUBGROUP / BLOCK_WIDTH : 1u;
const uint ROWS = BLOCK_HEIGHT / ROW_STEP;
const uint PIXELS = COLUMNS * ROWS;
const uint ROW_BLOCKS = TILE / BLOCK_WIDTH;
const uint TILE_BLOCKS = ROW_BLOCKS * (TILE / BLOCK_HEIGHT);
// Where splats are loaded lane by lane and pixels lie in memory, as by Mesa's llvmpipe, a splat is loaded once for all of a tile and a
// pixel is read once for two splats: a quarter less time there.
#ifdef BROADCAST
const uint OWN_BLOCKS = TILE_BLOCKS;
const bool PAIRS = true;
#else
const uint OWN_BLOCKS = 1u;
const bool PAIRS = false;
#endif
const uint BALLOT_WORDS = (SUBGROUP + 31u) / 32u;
const float TRANSMITTANCE_CUT = ALPHA_CUT;
const float NOTHING = -1e30; // of log2(alpha): none
// TEST_SLACK, room for rounding in the block test, which must never drop what a pixel would have kept: defined by the build script.

#ifndef BROADCAST
shared Splat handed[SUBGROUP];
#endif

float square(float x) { return x * x; }

// The block of a tile, in pixels.
uvec2 block_corner(uvec2 tile, uint block) {
    return tile * TILE + uvec2(block % ROW_BLOCKS, block / ROW_BLOCKS) * uvec2(BLOCK_WIDTH, BLOCK_HEIGHT);
}

// A pixel of a lane, from its block's corner: column after column.
uvec2 pixel_at(uint lane, uint pixel) {
    return uvec2(pixel / ROWS * SUBGROUP + lane % BLOCK_WIDTH, pixel % ROWS * ROW_STEP + lane / BLOCK_WIDTH);
}

// Greatest log2(alpha) of the splat over the pixel centres in [low, high].
float block_peak(Splat s, vec2 low, vec2 high) {
    vec2 near = low - vec2(s.mean_x, s.mean_y);
    vec2 far = high - vec2(s.mean_x, s.mean_y);
    if (near.x <= 0.0 && far.x >= 0.0 && near.y <= 0.0 && far.y >= 0.0) return s.log2_opacity;
    // The quadratic is convex: its least lies on a side that faces the mean.
    float least = 3.4e38;
    if (near.x > 0.0 || far.x < 0.0) {
        float x = near.x > 0.0 ? near.x : far.x;
        float y = clamp(-s.ux * s.uy * x / (s.uy * s.uy + s.wy * s.wy), near.y, far.y);
        least = square(s.ux * x + s.uy * y) + square(s.wy * y);
    }
    if (near.y > 0.0 || far.y < 0.0) {
        float y = near.y > 0.0 ? near.y : far.y;
        float x = clamp(-s.uy * y / s.ux, near.x, far.x);
        least = min(least, square(s.ux * x + s.uy * y) + square(s.wy * y));
    }
    return s.log2_opacity - least;
}

// How the other lanes get a lane's splat: by broadcasts, or through shared memory. Mesa's llvmpipe is 1.6 times as fast with
// broadcasts and has room for wider vectors; its turnip needs fewer instructions for shared memory.
#ifdef BROADCAST
void hand_out(uint lane, Splat own) {}
void wait_for_hands() {}
Splat take(Splat own, uint from) {
    return Splat(subgroupBroadcast(own.mean_x, from), subgroupBroadcast(own.mean_y, from),
                 subgroupBroadcast(own.ux, from), subgroupBroadcast(own.uy, from), subgroupBroadcast(own.wy, from),
                 subgroupBroadcast(own.log2_opacity, from), 0u, 0u);
}
vec4 colour_of(vec4 own_colour, Splat one, uint from) {
    return vec4(subgroupBroadcast(own_colour.r, from), subgroupBroadcast(own_colour.g, from),
                subgroupBroadcast(own_colour.b, from), DEPTH ? subgroupBroadcast(own_colour.a, from) : 0.0);
}
#else
vec4 colour_of(vec4 own_colour, Splat one, uint from) {
    return vec4(unpackHalf2x16(one.red_green), unpackHalf2x16(one.blue_depth));
}
void hand_out(uint lane, Splat own) { handed[lane] = own; }
void wait_for_hands() { subgroupBarrier(); }
Splat take(Splat own, uint from) { return handed[from]; }
#endif

// The lane's pixels: colour and depth, and the share of light that splats behind still get.
vec4 sum[OWN_BLOCKS * PIXELS];
float transmittance[OWN_BLOCKS * PIXELS];
vec2 middle[OWN_BLOCKS * COLUMNS]; // of its pixels in each column
uint open = (1u << OWN_BLOCKS) - 1u; // blocks that still let light through

// One splat in one pixel.
void blend(uint pixel, float log2_alpha, vec4 rgbz) {
    float alpha = log2_alpha >= LOG2_ALPHA_CUT ? min(exp2(log2_alpha), ALPHA_MOST) : 0.0;
    float weight = alpha * transmittance[pixel];
    sum[pixel].rgb += weight * rgbz.rgb;
    if (DEPTH) sum[pixel].a += weight * rgbz.a;
    transmittance[pixel] -= weight;
}

// log2(alpha) of a splat down a column: a parabola, from `peak` in the column's middle.
struct Fall { float peak, slope, bend; };

Fall fall_of(Splat one, vec2 from) {
    float dx = from.x - one.mean_x;
    float dy = from.y - one.mean_y;
    float along = one.ux * dx + one.uy * dy;
    float across = one.wy * dy;
    return Fall(one.log2_opacity - square(along) - square(across),
                2.0 * (along * one.uy + across * one.wy), square(one.uy) + square(one.wy));
}

// One splat, or two of which the first is in front, in the lane's pixels of a block.
void blend_block(uint b, Splat one, vec4 rgbz, Splat two, vec4 rgbz_two) {
    for (uint column = 0u; column < COLUMNS; ++column) {
        uint top = b * PIXELS + column * ROWS, bottom = top + ROWS - 1u;
        Fall fall = fall_of(one, middle[b * COLUMNS + column]);
        Fall fall_two = fall_of(two, middle[b * COLUMNS + column]);
        // A row above the middle and the one as far below share the parabola's even part.
        for (uint row = 0u; row < (ROWS + 1u) / 2u; ++row) {
            float y = 0.5 * float((ROWS - 1u - 2u * row) * ROW_STEP);
            float even = fall.peak - fall.bend * (y * y), odd = fall.slope * y;
            float even_two = fall_two.peak - fall_two.bend * (y * y), odd_two = fall_two.slope * y;
            blend(top + row, even + odd, rgbz);
            if (PAIRS) blend(top + row, even_two + odd_two, rgbz_two);
            if (2u * row + 1u == ROWS) continue;
            blend(bottom - row, even - odd, rgbz);
            if (PAIRS) blend(bottom - row, even_two - odd_two, rgbz_two);
        }
    }
}

void close_if_opaque(uint b) {
    float most = 0.0;
    for (uint i = 0u; i < PIXELS; ++i) most = max(most, transmittance[b * PIXELS + i]);
    if (subgroupAll(most < TRANSMITTANCE_CUT)) open &= ~(1u << b);
}

// Blends those of the lanes' splats that touch a block.
void draw_block(uint b, uvec2 block, bool is_listed, Splat own, vec4 own_colour) {
    vec2 low = vec2(block) + 0.5;
    vec2 high = min(vec2(block + uvec2(BLOCK_WIDTH, BLOCK_HEIGHT)), vec2(frame.width, frame.height)) - 0.5;
    bool is_open = OWN_BLOCKS == 1u || (open & (1u << b)) != 0u;
    bool touches = is_listed && is_open && block_peak(own, low, high) > LOG2_ALPHA_CUT - TEST_SLACK;
    uvec4 touching = subgroupBallot(touches);
    for (uint word = 0u; word < BALLOT_WORDS; ++word) {
        uint left = touching[word];
        if (left != 0u) {
            // Tested at its end: Mesa's llvmpipe runs the rest of a loop with no lanes where the test is before it.
            do {
                uint from = word * 32u + uint(findLSB(left));
                left &= left - 1u;
                Splat one = take(own, from), two = one;
                vec4 rgbz = colour_of(own_colour, one, from), rgbz_two = rgbz;
                if (PAIRS) {
                    uint behind = left != 0u ? word * 32u + uint(findLSB(left)) : from;
                    two = take(own, behind);
                    rgbz_two = colour_of(own_colour, two, behind);
                    // The last of an odd number is alone.
                    if (left == 0u) two.log2_opacity = NOTHING;
                    left &= left - 1u;
                }
                blend_block(b, one, rgbz, two, rgbz_two);
            } while (left != 0u);
            // Here, where it is left out together with the rest.
            if (BALLOT_WORDS == 1u) close_if_opaque(b);
        }
    }
    if (BALLOT_WORDS > 1u) close_if_opaque(b);
}

void main() {
    uint view = gl_WorkGroupID.z;
    uint lane = gl_SubgroupInvocationID;
    // Workgroups of one tile follow one another, since they read the same splats.
    uint groups = TILE_BLOCKS / OWN_BLOCKS;
    uint first = gl_WorkGroupID.x % groups;
    uvec2 tile = uvec2(gl_WorkGroupID.x / groups, gl_WorkGroupID.y);
    uvec2 size = uvec2(frame.width, frame.height);
    if (any(greaterThanEqual(block_corner(tile, first), size))) return;

    uint tile_count = frame.tiles_x * frame.tiles_y;
    uint list = view * tile_count + tile.y * frame.tiles_x + tile.x;
    uint start = tile_starts[list];
    uint end = tile_starts[list + 1u];
    // The picture was cleared: nothing to write for an empty block.
    if (start == end) return;
    // The lists did not fit and were not written; the host draws again.
    if (tile_starts[frame.view_count * tile_count] > frame.pair_capacity) return;

    for (uint i = 0u; i < OWN_BLOCKS * PIXELS; ++i) {
        uvec2 at = block_corner(tile, first + i / PIXELS) + pixel_at(lane, i % PIXELS);
        sum[i] = vec4(0.0);
        // Pixels beyond the picture's edge count as finished.
        transmittance[i] = all(lessThan(at, size)) ? 1.0 : 0.0;
    }

    for (uint i = 0u; i < OWN_BLOCKS * COLUMNS; ++i) {
        uvec2 at = block_corner(tile, first + i / COLUMNS) + pixel_at(lane, i % COLUMNS * ROWS);
        middle[i] = vec2(at) + vec2(0.5, 0.5 + 0.5 * float((ROWS - 1u) * ROW_STEP));
    }

    // A block beyond the picture's edge may stay open, so that its tile's whole list is walked; to close it here makes llvmpipe's loop a
    // quarter slower.
    uint base = start;
    do {
        Splat own;
        bool is_listed = base + lane < end;
        if (is_listed) {
            uint index = pairs[base + lane];
            if (view == 0u) own = splats_0[index];
            else own = splats_1[index];
            // Before the tests, so that little of it has to stay in registers.
            hand_out(lane, own);
        }
        vec4 own_colour = vec4(unpackHalf2x16(own.red_green), unpackHalf2x16(own.blue_depth));
        wait_for_hands();
        // Written out: compilers keep a loop that holds loops, and its blocks' pixels then lie in memory.
        draw_block(0u, block_corner(tile, first), is_listed, own, own_colour);
        if (OWN_BLOCKS > 1u) draw_block(1u, block_corner(tile, first + 1u), is_listed, own, own_colour);
        if (OWN_BLOCKS > 2u) draw_block(2u, block_corner(tile, first + 2u), is_listed, own, own_colour);
        if (OWN_BLOCKS > 3u) draw_block(3u, block_corner(tile, first + 3u), is_listed, own, own_colour);
        if (open == 0u) break;
        wait_for_hands();
        base += SUBGROUP;
    } while (base < end);

    for (uint i = 0u; i < OWN_BLOCKS * PIXELS; ++i) {
        uvec2 at = block_corner(tile, first + i / PIXELS) + pixel_at(lane, i % PIXELS);
        // The neighbour to the right; nothing where the picture ends.
        float next_depth = subgroupShuffleXor(sum[i].a, 1u);
        if (all(lessThan(at, size))) {
            uint row = view * size.y + at.y;
            picture[row * size.x + at.x] = uvec2(
                packHalf2x16(sum[i].rg), packHalf2x16(vec2(sum[i].b, 1.0 - transmittance[i])));
            if (DEPTH && (at.x & 1u) == 0u) {
                depth_picture[row * ((size.x + 1u) / 2u) + at.x / 2u] = packHalf2x16(vec2(sum[i].a, next_depth));
            }
        }
    }
}
