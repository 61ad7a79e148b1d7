// Counting sort of items by a key of 16 bits (up to 20 for millions of items) cut from their 32-bit values, then exactly by (value, item) within each key.
// Values are the bits of positive floats. Those in the fine range get most of the keys, spread evenly over metres;
// the rest shares the others by the bits' own scale, a piecewise linear logarithm: a far wall does not press a near
// face into a few keys.

layout(set = 0, binding = 0, std430) readonly buffer Values { uint values[]; };  // by item
layout(set = 0, binding = 1, std430) readonly buffer Items { uint items[]; };
#define STATE_BINDING 2
#include "state.glsl"
layout(set = 0, binding = 3, std430) buffer Bins { uint bins[]; };

// CROWDED, the items of one bin that are still ranked one by one, and ITEMS_PER_PART (see sort_part.glsl): defined by the build script, from src/shared.rs.

// Never falls as the value rises, in float arithmetic too: rounding is monotonic.
uint key_of(uint value) {
    if (value < state.fine_least || state.linear_keys == 0u) return (value - state.least) >> state.log_shift;
    if (value <= state.fine_greatest) {
        float metres = uintBitsToFloat(value) - uintBitsToFloat(state.fine_least);
        return state.linear_start + min(uint(metres * state.linear_scale), state.linear_keys - 1u);
    }
    return state.linear_start + state.linear_keys + ((value - state.fine_greatest) >> state.log_shift);
}

uint start_of(uint bin) { return bin == 0u ? 0u : bins[bin - 1u]; }
