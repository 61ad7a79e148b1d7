// What projection, listing and blending agree on; as tools/splat-gradient has it.
#ifndef NUMBERS
#define NUMBERS

const uint TILE = 16u;  // pixels along a tile's sides
const uint RUN = 8u;    // pixels of a row that stop together
const uint MOMENTS = 9u; // of a splat: sums of h, h dx, h dx^2, h dy, h dx dy, h dy^2, then derivatives by red, green and blue
const uint NONE = 0xFFFFFFFFu;

const float LOG2_ALPHA_CUT = -7.9943534; // log2(1/255)
const float ALPHA_CUT_SLACK = 1e-3;      // room for rounding where a test must never drop what a pixel would have kept

// A projected Gaussian: alpha = 2^(log2_opacity - (ux dx + uy dy)^2 - (w dy)^2) at dx, dy pixels from its mean. 44 bytes.
struct Splat {
    float mean_x, mean_y;
    float ux, uy;
    float w;
    float log2_opacity;
    float red, green, blue; // not below 0
    uint columns, rows;     // first and, from bit 16 on, last of the pixels that it may reach, within the picture
};

uint first_of(uint range) { return range & 0xFFFFu; }
uint last_of(uint range) { return range >> 16; }

// By their bits: comparisons may be compiled as if every number were one.
bool finite(float x) { return (floatBitsToUint(x) & 0x7F800000u) != 0x7F800000u; }
bool finite(vec3 v) { return finite(v.x) && finite(v.y) && finite(v.z); }
bool not_a_number(float x) { return (floatBitsToUint(x) & 0x7FFFFFFFu) > 0x7F800000u; }
#endif
