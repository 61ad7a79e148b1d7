// The exact order within a bin.

layout(set = 0, binding = 4, std430) buffer Order { uint order[]; };

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
