#version 450
#extension GL_GOOGLE_include_directive : require
#include "sort.glsl"

layout(constant_id = 0) const uint GROUP = 64u;
layout(local_size_x_id = 0) in;

layout(set = 0, binding = 3, std430) buffer Order { uint order[]; };

const uint INSERTION_LIMIT = 24u;

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

void sift_down(uint start, uint root, uint count) {
    uint moved = order[start + root];
    for (uint child = 2u * root + 1u; child < count; child = 2u * root + 1u) {
        if (child + 1u < count && before(order[start + child], order[start + child + 1u])) ++child;
        if (!before(moved, order[start + child])) break;
        order[start + root] = order[start + child];
        root = child;
    }
    order[start + root] = moved;
}

// For the rare crowded bin (all Gaussians at one depth, say): n log n where insertion would take n^2.
void heap_sort(uint start, uint count) {
    for (uint i = count / 2u; i > 0u; --i) sift_down(start, i - 1u, count);
    for (uint left = count - 1u; left > 0u; --left) {
        uint largest = order[start];
        order[start] = order[start + left];
        order[start + left] = largest;
        sift_down(start, 0u, left);
    }
}

// One invocation per bin: (value, index) order, whatever order the scatter's atomics fell in.
void main() {
    uint bin = gl_GlobalInvocationID.x;
    if (bin >= bins.length()) return;
    uint start = bin == 0u ? 0u : bins[bin - 1u];
    uint end = bins[bin];
    uint count = end - start;
    if (count < 2u) return;
    if (count <= INSERTION_LIMIT) insertion_sort(start, end);
    else heap_sort(start, count);
}
