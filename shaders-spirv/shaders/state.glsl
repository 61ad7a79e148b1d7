// The range of the sort's input, and the counts that later passes are dispatched with. Mirrors `SortState` in
// src/frame.rs. Include after `#define STATE_BINDING`, and
// `#define STATE_ACCESS readonly` where it is only read (a vertex shader may not do more).
#ifndef STATE_ACCESS
#define STATE_ACCESS
#endif

layout(set = 0, binding = STATE_BINDING, std430) STATE_ACCESS buffer State {
    // Written while items are collected.
    uint count;               // items to sort
    uint least, greatest;     // values of all items
    uint fine_least, fine_greatest; // the range with fine keys: the foreground's
    // Written by sort_plan.comp.
    uint linear_start;        // first key of the fine range
    uint linear_keys;         // keys it has; 0 where there is none
    float linear_scale;       // keys a metre there
    uint log_shift;           // outside of it: value bits per key
    // Indirect arguments.
    uint items_groups[3];
    uint crowded_groups[3];
    uint part_items_groups[3];
    uint parts_groups[3];
    uint merge_groups[3];
    uint draw[5];
    // Written by weigh.comp for each picture: 1 where nothing may be drawn.
    uint refused;
} state;
