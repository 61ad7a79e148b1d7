// A crowded bin (many Gaussians at one depth) is counted and scattered once more, into parts by the bits of value and item
// that differ within it. Equal values are parted by item, and items are distinct: a part gets few of them however many
// are equal. Bins do not overlap, so that a bin's parts lie where its items do: one for every four of them.
#include "sort.glsl"

layout(set = 0, binding = 4, std430) readonly buffer PlacedValues { uint placed_values[]; };
#ifndef MERGES
layout(set = 0, binding = 5, std430) readonly buffer PlacedItems { uint placed_items[]; };
layout(set = 0, binding = 6, std430) buffer Order { uint order[]; };
#endif
layout(set = 0, binding = 7, std430) buffer Crowded { uint crowded[]; }; // bins, then parts that are still crowded
struct Span {
    uint least_value, least_item;
    uint value_bits, item_bits; // that it takes to tell the bin's values and items apart
};
layout(set = 0, binding = 8, std430) buffer Spans { Span spans[]; };
// [part]: first how many items it has, then where the next one goes: at last its end.
layout(set = 0, binding = 9, std430) buffer Parts { uint parts[]; };

// Bins that are crowded start more than CROWDED items apart: each has a span of its own.
uint span_of(uint start) { return start / (CROWDED + 1u); }

uint first_part(uint start) { return (start + ITEMS_PER_PART - 1u) / ITEMS_PER_PART; }
uint end_part(uint end) { return end / ITEMS_PER_PART; }

// The items of a part once all are placed.
uvec2 items_of(uint part, uint bin_start) {
    return uvec2(part == first_part(bin_start) ? bin_start : parts[part - 1u], parts[part]);
}

// Never falls as (value, item) rises.
uint part_of(uint value, uint item, uint start, uint end) {
    Span span = spans[span_of(start)];
    uint first = first_part(start);
    uint high = value - span.least_value;
    uint low = item - span.least_item;
    // The upper bits of (high, low), as many as there are parts for.
    int part_bits = findMSB(end_part(end) - first);
    int drop = int(span.value_bits + span.item_bits) - part_bits;
    int item_bits = int(span.item_bits);
    if (drop >= item_bits) return first + (high >> (drop - item_bits));
    if (drop > 0) return first + ((high << (item_bits - drop)) | (low >> drop));
    return first + ((high << item_bits) | low);
}
