#version 450
#extension GL_GOOGLE_include_directive : require
#define STATE_BINDING 0
#include "state.glsl"
#define COSTS_BINDING 1
#include "costs.glsl"

// One invocation: refuses a picture whose foreground covers too many tiles, before anything works on them. The host reads the same
// counts, and draws again without the part that costs most.

layout(constant_id = 0) const uint MOST_EACH = 1u; // pairs of a part
layout(constant_id = 1) const uint MOST_ALL = 1u;  // and of all parts
layout(local_size_x = 1) in;

void main() {
    bool refused = false;
    uint sum = 0u;
    for (uint part = 0u; part < MOST_PARTS; ++part) {
        uint pairs = costs.pairs[2u * part];
        if (costs.pairs[2u * part + 1u] > 0u || pairs > MOST_EACH) refused = true;
        else sum += pairs;
    }
    state.refused = refused || sum > MOST_ALL ? 1u : 0u;
}
