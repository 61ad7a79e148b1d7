// A Gaussian in 32 bytes, as src/gaussian.rs packs it, and back: what the host uploads, what posing keeps and what
// projection reads.
#include "numbers.glsl"

const float SCALE_STEPS = 2048.0;
const float SCALE_LEAST = -24.0;
const float SCALE_END = 8.0;
const float LOG2_MOST_SCALE = -1.0; // of a person's Gaussians
const float ROTATION_MOST = 32766.0;
const float OPACITY_MOST = 65535.0;
const float SQRT_HALF = 0.7071067811865476;
const float LEAST_HALF = 6.103515625e-5; // that is normal

// Plain numbers: activated, in world space.
struct PlainGaussian {
    vec3 position;   // metres
    vec4 rotation;   // unit quaternion x, y, z, w
    vec3 log2_scale; // of the standard deviations in metres
    float opacity;   // 0..1
    vec3 colour;     // display values
};

// words 0..3 and 4..7
struct PackedGaussian { uvec4 low; uvec4 high; };

float unpacked_opacity(PackedGaussian g) { return float(g.high.x >> 16) / OPACITY_MOST; }

PlainGaussian unpacked(PackedGaussian g) {
    PlainGaussian plain;
    plain.position = uintBitsToFloat(g.low.xyz);
    plain.log2_scale = vec3(g.low.w & 0xFFFFu, g.low.w >> 16, g.high.x & 0xFFFFu) / SCALE_STEPS + SCALE_LEAST;
    vec3 steps = vec3(g.high.y & 0x7FFFu, (g.high.y >> 15) & 0x7FFFu, g.high.z & 0xFFFFu);
    plain.rotation = quaternion(g.high.y >> 30, (steps / ROTATION_MOST - 0.5) * SQRT_2);
    plain.opacity = unpacked_opacity(g);
    plain.colour = vec3(unpackHalf2x16(g.high.z).y, unpackHalf2x16(g.high.w));
    return plain;
}

// Whether it is the one that means "never drawn": three numbers of -1/sqrt(2) are in no unit quaternion.
bool never_drawn(PackedGaussian g) { return g.high.y == 0u && (g.high.z & 0xFFFFu) == 0u; }

uint quantised(float value, float most) { return uint(clamp(value, 0.0, most) + 0.5); }

// The nearest half, by whole numbers alone: drivers may round packHalf2x16 as they like.
uint half_bits(float value) {
    if (value < LEAST_HALF) return 0u;
    return (floatBitsToUint(min(value, MOST_HALF)) + 0x1000u - (112u << 23)) >> 13;
}

PackedGaussian packed(PlainGaussian g) {
    float length_2 = dot(g.rotation, g.rotation);
    vec3 sums = g.position + g.colour;
    float sum = sums.x + sums.y + sums.z + g.opacity + length_2;
    if (!finite(sum) || !(length_2 > 0.0) || !all(lessThan(g.log2_scale, vec3(SCALE_END)))) {
        return PackedGaussian(uvec4(0u), uvec4(0u));
    }
    vec4 unit = g.rotation * inversesqrt(length_2);
    vec4 size = abs(unit);
    uint largest = 3u;
    float left_out = unit.w;
    vec3 others = unit.xyz;
    if (size.x >= size.y && size.x >= size.z && size.x >= size.w) {
        largest = 0u;
        left_out = unit.x;
        others = unit.yzw;
    } else if (size.y >= size.z && size.y >= size.w) {
        largest = 1u;
        left_out = unit.y;
        others = unit.xzw;
    } else if (size.z >= size.w) {
        largest = 2u;
        left_out = unit.z;
        others = unit.xyw;
    }
    others *= left_out < 0.0 ? -SQRT_HALF : SQRT_HALF;
    uvec3 turn = uvec3(clamp((others + 0.5) * ROTATION_MOST, 0.0, ROTATION_MOST) + 0.5);
    uvec3 scale = uvec3(clamp((g.log2_scale - SCALE_LEAST) * SCALE_STEPS, 0.0, 65535.0) + 0.5);
    uvec4 low = uvec4(floatBitsToUint(g.position), scale.x | (scale.y << 16));
    uvec4 high = uvec4(
        scale.z | (quantised(g.opacity * OPACITY_MOST, OPACITY_MOST) << 16),
        turn.x | (turn.y << 15) | (largest << 30),
        turn.z | (half_bits(g.colour.r) << 16),
        half_bits(g.colour.g) | (half_bits(g.colour.b) << 16));
    return PackedGaussian(low, high);
}
