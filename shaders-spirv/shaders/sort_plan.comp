#version 450
#extension GL_GOOGLE_include_directive : require
#define STATE_BINDING 0
#include "state.glsl"

// One invocation: divides the keys between the fine range and the rest, and sizes the passes that follow.

layout(constant_id = 0) const uint SORT_GROUP = 256u;
layout(constant_id = 1) const uint QUADS_PER_INSTANCE = 1u;
layout(constant_id = 2) const uint KEYS = 65536u;
layout(local_size_x = 1) in;

const uint LOG_KEYS = KEYS / 4u; // at most this many outside of the fine range
const float FINEST = 1e-7;     // metres a key: finer is below an f32's resolution

void main() {
    bool fine = state.fine_least <= state.fine_greatest;
    uint below = fine ? state.fine_least - state.least : 0u;
    uint above = fine ? state.greatest - state.fine_greatest : 0u;
    uint log_keys = fine ? LOG_KEYS : KEYS;
    uint span = fine ? below + above : state.greatest - state.least;
    uint shift = 0u;
    // Each part rounds up by one key.
    uint parts = fine ? 2u : 1u;
    while ((span >> shift) + parts > log_keys) ++shift;
    uint used = fine ? (below >> shift) + (above >> shift) + 2u : 0u;
    float metres = uintBitsToFloat(state.fine_greatest) - uintBitsToFloat(state.fine_least);
    state.log_shift = shift;
    state.linear_start = (below >> shift) + 1u;
    state.linear_keys = fine ? KEYS - used : 0u;
    state.linear_scale = fine ? float(state.linear_keys) / max(metres, FINEST * float(state.linear_keys)) : 0.0;

    state.items_groups[0] = (state.count + SORT_GROUP - 1u) / SORT_GROUP;
    state.items_groups[1] = 1u;
    state.items_groups[2] = 1u;
    state.crowded_groups[0] = 0u;
    state.crowded_groups[1] = 1u;
    state.crowded_groups[2] = 1u;
    state.part_items_groups[0] = 0u;
    state.part_items_groups[1] = 1u;
    state.part_items_groups[2] = 1u;
    state.parts_groups[0] = 0u;
    state.parts_groups[1] = 1u;
    state.parts_groups[2] = 1u;
    state.merge_groups[0] = 0u;
    state.merge_groups[1] = 1u;
    state.merge_groups[2] = 1u;
    state.draw[0] = 12u * QUADS_PER_INSTANCE; // four triangles each
    state.draw[1] = (state.count + QUADS_PER_INSTANCE - 1u) / QUADS_PER_INSTANCE;
    state.draw[2] = 0u;
    state.draw[3] = 0u;
    state.draw[4] = 0u;
}
