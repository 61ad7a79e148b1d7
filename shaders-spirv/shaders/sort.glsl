// Counting sort of 32-bit values by a 16-bit key cut from them, then exactly within each key.
// The key is the value's offset in [least, greatest], shifted so that it fits 16 bits: for the bits of
// positive floats a piecewise linear logarithm, so one far point does not press all others into one bin.

const uint DROPPED_VALUE = 0xFFFFFFFFu; // never sorted, never counted

layout(push_constant) uniform SortParams { uint value_count; } params;

layout(set = 0, binding = 0, std430) readonly buffer Values { uint values[]; };
layout(set = 0, binding = 1, std430) readonly buffer Range { uint least; uint greatest; } range;
layout(set = 0, binding = 2, std430) buffer Bins { uint bins[]; };

uint key_of(uint value) {
    uint span = range.greatest - range.least;
    int top_bit = findMSB(span); // -1 for 0
    return (value - range.least) >> uint(max(top_bit - 15, 0));
}
