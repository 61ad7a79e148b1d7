// Tests for finite numbers, signed bytes, and rotations in three numbers.
#ifndef NUMBERS
#define NUMBERS

const float SQRT_2 = 1.4142135623730951;
const float MOST_HALF = 65504.0;

bool finite(float x) { return (floatBitsToUint(x) & 0x7F800000u) != 0x7F800000u; }
bool finite(vec3 v) { return finite(v.x) && finite(v.y) && finite(v.z); }
bool finite(vec4 v) { return finite(v.xyz) && finite(v.w); }

// Four signed bytes.
vec4 signed_bytes(uint word) {
    return vec4(int(word) << 24 >> 24, int(word) << 16 >> 24, int(word) << 8 >> 24, int(word) >> 24);
}

// A unit quaternion from which number was left out, being the largest, and the other three in -1/sqrt(2)..1/sqrt(2).
vec4 quaternion(uint largest, vec3 others) {
    float rest = sqrt(max(0.0, 1.0 - dot(others, others)));
    if (largest == 0u) return vec4(rest, others);
    if (largest == 1u) return vec4(others.x, rest, others.yz);
    if (largest == 2u) return vec4(others.xy, rest, others.z);
    return vec4(others, rest);
}
#endif
