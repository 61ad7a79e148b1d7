#version 450
#extension GL_GOOGLE_include_directive : require
#define MERGES
#include "sort_part.glsl"

// One workgroup per part that is crowded itself: a merge sort in which all invocations take part in every merge, so that
// no distribution of values runs into a watchdog.

const uint MERGERS = 256u;
const uint RUN = 16u; // items that one invocation sorts before merging begins
layout(local_size_x = 256) in;

layout(set = 0, binding = 5, std430) coherent buffer PlacedItems { uint placed_items[]; };
layout(set = 0, binding = 6, std430) coherent buffer Order { uint order[]; };

bool from_order; // which of the two holds the runs

uint item_at(uint at) { return from_order ? order[at] : placed_items[at]; }

void put(uint at, uint item) {
    if (from_order) placed_items[at] = item;
    else order[at] = item;
}

bool before(uint i, uint j) {
    uint a = values[i];
    uint b = values[j];
    return a < b || (a == b && i < j);
}

void insertion_sort(uint start, uint end) {
    for (uint i = start + 1u; i < end; ++i) {
        uint moved = order[i];
        uint hole = i;
        while (hole > start && before(moved, order[hole - 1u])) {
            order[hole] = order[hole - 1u];
            --hole;
        }
        order[hole] = moved;
    }
}

// How many of the first `taken` of the merged runs a and b come from a ("merge path").
uint share_of(uint a, uint a_count, uint b, uint b_count, uint taken) {
    uint low = taken > b_count ? taken - b_count : 0u;
    uint high = min(taken, a_count);
    while (low < high) {
        uint middle = (low + high) / 2u;
        if (before(item_at(a + middle), item_at(b + taken - 1u - middle))) low = middle + 1u;
        else high = middle;
    }
    return low;
}

// This invocation's part of the merge of two neighbouring runs: positions from..to of the pair that starts at `pair`.
void merge(uint pair, uint end, uint width, uint from, uint to) {
    uint a = pair, b = min(pair + width, end);
    uint a_count = b - a, b_count = min(b + width, end) - b;
    uint i = share_of(a, a_count, b, b_count, from - pair);
    uint j = from - pair - i;
    for (uint at = from; at < to; ++at) {
        bool take_a = j >= b_count || (i < a_count && before(item_at(a + i), item_at(b + j)));
        put(at, item_at(take_a ? a + i : b + j));
        if (take_a) ++i;
        else ++j;
    }
}

void main() {
    uint part = crowded[gl_WorkGroupID.x];
    uvec2 own = items_of(part, start_of(key_of(placed_values[part * ITEMS_PER_PART])));
    uint start = own.x;
    uint end = own.y;
    uint me = gl_LocalInvocationID.x;
    for (uint run = start + me * RUN; run < end; run += MERGERS * RUN) insertion_sort(run, min(run + RUN, end));
    memoryBarrierBuffer();
    barrier();

    from_order = true;
    uint per_merger = (end - start + MERGERS - 1u) / MERGERS;
    for (uint width = RUN; width < end - start; width *= 2u) {
        uint at = start + me * per_merger;
        uint last = min(at + per_merger, end);
        while (at < last) {
            uint pair = start + (at - start) / (2u * width) * (2u * width);
            uint to = min(last, min(pair + 2u * width, end));
            merge(pair, end, width, at, to);
            at = to;
        }
        memoryBarrierBuffer();
        barrier();
        from_order = !from_order;
    }
    if (!from_order) {
        for (uint at = start + me; at < end; at += MERGERS) order[at] = placed_items[at];
    }
}
