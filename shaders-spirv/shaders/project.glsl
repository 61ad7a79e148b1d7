// EWA projection of one Gaussian into each view, and the collecting of those worth sorting.
// Formulas: Zwicker et al., "EWA Splatting" (2001); Kerbl et al., "3D Gaussian Splatting" (2023), whose public code
// sets the 0.3 px^2 low-pass and the 1.3 tan(fov) limit of the Jacobian; Yu et al., "Mip-Splatting" (2024).
#include "frame.glsl"

layout(constant_id = 0) const uint GROUP = 64u;
layout(constant_id = 1) const bool MIP_FILTER = false;
layout(local_size_x_id = 0) in;

layout(set = 0, binding = 1, std430) writeonly buffer Splats0 { Splat splats_0[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Splats1 { Splat splats_1[]; };
layout(set = 0, binding = 3, std430) writeonly buffer Rects { uint rects[]; };
layout(set = 0, binding = 4, std430) writeonly buffer Depths { uint depths[]; };
layout(set = 0, binding = 5, std430) writeonly buffer Items { uint items[]; };
#define STATE_BINDING 6
#include "state.glsl"

const float SQRT_HALF_LOG2_E = 0.8493218002880191; // sqrt(log2(e) / 2)
const float LN_2 = 0.6931471805599453;
// 3DGS widens every splat by 0.3 px^2. The Mip filter widens by its box filter's 0.1 px^2 and fades accordingly.
const float LOW_PASS = MIP_FILTER ? 0.1 : 0.3;

// Columns: the Gaussian's axes in the world, each as long as its standard deviation.
mat3 scaled_axes(vec4 q, vec3 scale) {
    vec3 x = vec3(1.0 - 2.0 * (q.y * q.y + q.z * q.z), 2.0 * (q.x * q.y + q.w * q.z), 2.0 * (q.x * q.z - q.w * q.y));
    vec3 y = vec3(2.0 * (q.x * q.y - q.w * q.z), 1.0 - 2.0 * (q.x * q.x + q.z * q.z), 2.0 * (q.y * q.z + q.w * q.x));
    vec3 z = vec3(2.0 * (q.x * q.z + q.w * q.y), 2.0 * (q.y * q.z - q.w * q.x), 1.0 - 2.0 * (q.x * q.x + q.y * q.y));
    return mat3(x * scale.x, y * scale.y, z * scale.z);
}

// A Gaussian projected into one view.
struct Seen {
    bool kept;  // in the order, which may serve heads that turned and moved a little
    uint rect;  // tiles it may touch now, or EMPTY_RECT
    Splat splat;
};

// Whether anyone sees one of these tiles, found at the first row as a rule.
bool is_visible(uint view, uvec2 first, uvec2 last) {
    if (is_whole(first.y, last.y)) return true;
    for (uint row = first.y; row <= last.y; ++row) {
        uvec2 columns = visible_columns(view, row);
        if (first.x <= columns.y && last.x >= columns.x && columns.x <= columns.y) return true;
    }
    return false;
}

Seen see(uint view, vec3 position, float opacity, mat3 axes) {
    ViewParams v = frame.views[view];
    Seen seen;
    seen.kept = false;
    seen.rect = EMPTY_RECT;
    vec4 p = vec4(position, 1.0);
    vec3 t = vec3(dot(v.image_from_world[0], p), dot(v.image_from_world[1], p), dot(v.image_from_world[2], p));
    float near = v.clip.w;
    if (!(t.z > near)) {
        seen.kept = t.z > near - frame.guard_move;
        return seen;
    }

    float inv_z = 1.0 / t.z;
    vec2 slope = clamp(t.xy * inv_z, v.slope_limits.xz, v.slope_limits.yw);
    vec3 view_z = v.image_from_world[2].xyz;
    // Rows of J * W, then of J * W * axes: the 2x3 root of the image covariance.
    vec3 root_x = (v.intrinsics.x * inv_z * (v.image_from_world[0].xyz - slope.x * view_z)) * axes;
    vec3 root_y = (v.intrinsics.y * inv_z * (v.image_from_world[1].xyz - slope.y * view_z)) * axes;
    float a0 = dot(root_x, root_x);
    float c0 = dot(root_y, root_y);
    float a = a0 + LOW_PASS;
    float b = dot(root_x, root_y);
    float c = c0 + LOW_PASS;
    // Cauchy-Binet instead of a*c - b*b, which cancels for thin splats.
    vec3 minors = cross(root_x, root_y);
    float det_0 = dot(minors, minors);
    float det = det_0 + LOW_PASS * (a0 + c0) + LOW_PASS * LOW_PASS;

    float log2_opacity = log2(opacity);
    if (MIP_FILTER) log2_opacity += 0.5 * log2(det_0 / det);
    vec2 mean = v.intrinsics.xy * t.xy * inv_z + v.intrinsics.zw;
    float q_cut = 2.0 * LN_2 * (log2_opacity - LOG2_ALPHA_CUT);
    // Where alpha reaches ALPHA_CUT: by opacity, not by three standard deviations.
    vec2 reach = sqrt(q_cut * vec2(a, c));
    if (!(q_cut > 0.0) || !finite(vec4(mean, reach)) || !finite(c * det)) return seen;

    vec2 low = mean - reach;
    vec2 high = mean + reach;
    vec2 size = vec2(frame.width, frame.height);
    vec2 guard = v.intrinsics.xy * (frame.guard_turn * (1.0 + dot(slope, slope)) + frame.guard_move * inv_z);
    seen.kept = all(greaterThan(high, -guard)) && all(lessThan(low, size + guard));
    // The first and the last pixel centre inside; there may be none.
    vec2 first = max(ceil(low - 0.5), vec2(0.0));
    vec2 last = min(floor(high - 0.5), size - 1.0);
    if (any(greaterThan(first, last))) return seen;
    uvec2 first_tile = uvec2(first) / TILE;
    uvec2 last_tile = uvec2(last) / TILE;
    // What is kept for the order does not depend on it: the order is that of a picture that is seen wholly.
    if (!is_visible(view, first_tile, last_tile)) return seen;
    seen.rect = first_tile.x | (first_tile.y << 8) | (last_tile.x << 16) | (last_tile.y << 24);

    float inv_root = SQRT_HALF_LOG2_E * inversesqrt(c * det);
    seen.splat.mean_x = mean.x;
    seen.splat.mean_y = mean.y;
    seen.splat.ux = inv_root * c;
    seen.splat.uy = -inv_root * b;
    seen.splat.wy = SQRT_HALF_LOG2_E * inversesqrt(c);
    seen.splat.log2_opacity = log2_opacity;
    seen.splat.blue_depth = packHalf2x16(vec2(0.0, min(t.z, MOST_HALF)));
    return seen;
}

void paint(inout Splat splat, vec3 colour) {
    // More than the largest half is no colour but would become infinite; below 0 is drawn as 0, as 3DGS does.
    vec3 held = clamp(colour, vec3(0.0), vec3(MOST_HALF));
    splat.red_green = packHalf2x16(held.rg);
    splat.blue_depth = (splat.blue_depth & 0xFFFF0000u) | packHalf2x16(vec2(held.b, 0.0));
}

// The bits of a positive float rise with it: an exact integer to sort by. Converging eyes may see a point behind the
// head's plane: nearest of all.
uint depth_bits(vec3 position) {
    float metres = dot(frame.depth_plane.xyz, position) + frame.depth_plane.w;
    return metres > 0.0 ? floatBitsToUint(metres) : 0u;
}

// Adds the invocation's Gaussian to those that are sorted. All invocations of the subgroup call this together.
void collect(uint index, bool kept, uint depth, bool fine) {
    if (frame.sorts == 0u) return;
    uvec4 ballot = subgroupBallot(kept);
    uint found = subgroupBallotBitCount(ballot);
    if (found == 0u) return;
    uint first = 0u;
    uint least = subgroupMin(kept ? depth : NO_DEPTH);
    uint greatest = subgroupMax(kept ? depth : 0u);
    if (subgroupElect()) {
        first = atomicAdd(state.count, found);
        atomicMin(state.least, least);
        atomicMax(state.greatest, greatest);
        if (fine) {
            atomicMin(state.fine_least, least);
            atomicMax(state.fine_greatest, greatest);
        }
    }
    first = subgroupBroadcastFirst(first);
    if (kept) {
        items[first + subgroupBallotExclusiveBitCount(ballot)] = index;
        depths[index] = depth;
    }
}
