#version 450
#extension GL_GOOGLE_include_directive : require
#include "packed_gaussian.glsl"

// Gaussians on a posed mesh: one invocation for each mixes its controllers' potentials into a force, weighs the bases of
// its 14 attributes by it, and carries the result from its triangle's frame into the world.
//
// Bases lie in blocks of 16, one byte each and a uvec4 a block, Gaussians side by side: every byte is read once, in words
// that neighbouring invocations read together.

layout(constant_id = 0) const uint GROUP = 64u;
layout(constant_id = 1) const uint BLOCKS = 1u; // of bases
layout(local_size_x_id = 0) in;

layout(push_constant) uniform Params {
    uint gaussian_count;
    uint first_force; // where this state's potentials begin, in vec4s
    uint first_posed; // where its posed vertices do
    uint first_state; // where its Gaussians go
    float root_x, root_y, root_z; // metres, added to what is posed
} params;

layout(set = 0, binding = 0, std140) uniform Units { vec4 units[4]; }; // of each attribute's scale
layout(set = 0, binding = 1, std430) readonly buffer Potentials { vec4 potentials[]; }; // 4 BLOCKS a controller
layout(set = 0, binding = 2, std430) readonly buffer Posed { vec4 posed[]; };
layout(set = 0, binding = 3, std430) readonly buffer Bound { uint bound[]; };           // 10 planes
layout(set = 0, binding = 4, std430) readonly buffer Attributes { float attributes[]; }; // 14 planes
layout(set = 0, binding = 5, std430) readonly buffer Scales { uint scales[]; };         // 7 planes of two halves
layout(set = 0, binding = 6, std430) readonly buffer Bases { uvec4 bases[]; };          // 14 * BLOCKS planes
layout(set = 0, binding = 7, std430) writeonly buffer States { PackedGaussian states[]; };

const float LOG2_E = 1.4426950408889634;
const float SH_C0 = 0.28209479177387814;
const float LEAST_NORMAL = 1.17549435e-38; // what is below may be 0 to the device

vec4 force[4u * BLOCKS];
uint gaussian;

float read(uint plane) { return uintBitsToFloat(bound[plane * params.gaussian_count + gaussian]); }

void pull(uint controller, float mass) {
    uint at = params.first_force + controller * 4u * BLOCKS;
    for (uint q = 0u; q < 4u * BLOCKS; ++q) force[q] += mass * potentials[at + q];
}

float weighed(uint plane) {
    float sum = 0.0;
    for (uint block = 0u; block < BLOCKS; ++block) {
        uvec4 words = bases[(plane * BLOCKS + block) * params.gaussian_count + gaussian];
        sum += dot(signed_bytes(words.x), force[4u * block]);
        sum += dot(signed_bytes(words.y), force[4u * block + 1u]);
        sum += dot(signed_bytes(words.z), force[4u * block + 2u]);
        sum += dot(signed_bytes(words.w), force[4u * block + 3u]);
    }
    return sum;
}

// Template and residual of two neighbouring planes.
vec2 attribute_pair(uint pair) {
    uint plane = 2u * pair;
    uint count = params.gaussian_count;
    vec2 scale = unpackHalf2x16(scales[pair * count + gaussian]);
    vec4 four = units[pair / 2u];
    vec2 unit = (pair & 1u) == 0u ? four.xy : four.zw;
    vec2 rest = vec2(attributes[plane * count + gaussian], attributes[(plane + 1u) * count + gaussian]);
    return rest + scale * unit * vec2(weighed(plane), weighed(plane + 1u));
}

vec4 product(vec4 a, vec4 b) {
    return vec4(a.w * b.xyz + b.w * a.xyz + cross(a.xyz, b.xyz), a.w * b.w - dot(a.xyz, b.xyz));
}

// Any unit vector across a unit vector (Duff et al., "Building an Orthonormal Basis, Revisited", 2017).
vec3 across(vec3 v) {
    float side = floatBitsToInt(v.z) < 0 ? -1.0 : 1.0;
    float a = -1.0 / (side + v.z);
    return vec3(v.x * v.y * a, side + v.y * v.y * a, -v.y);
}

// The quaternion of a rotation with these columns, by way of its largest number (Day, "Converting a Rotation Matrix to a
// Quaternion").
vec4 quaternion_of(vec3 x, vec3 y, vec3 z) {
    vec4 q;
    float largest;
    if (z.z <= 0.0) {
        if (y.y <= x.x) {
            largest = 1.0 + x.x - y.y - z.z;
            q = vec4(largest, x.y + y.x, x.z + z.x, y.z - z.y);
        } else {
            largest = 1.0 - x.x + y.y - z.z;
            q = vec4(x.y + y.x, largest, y.z + z.y, z.x - x.z);
        }
    } else if (x.x <= -y.y) {
        largest = 1.0 - x.x - y.y + z.z;
        q = vec4(x.z + z.x, y.z + z.y, largest, x.y - y.x);
    } else {
        largest = 1.0 + x.x + y.y + z.z;
        q = vec4(y.z - z.y, z.x - x.z, x.y - y.x, largest);
    }
    return q * (0.5 * inversesqrt(largest));
}

void main() {
    gaussian = gl_GlobalInvocationID.x;
    if (gaussian >= params.gaussian_count) return;
    for (uint q = 0u; q < 4u * BLOCKS; ++q) force[q] = vec4(0.0);
    uint two = floatBitsToUint(read(5u));
    pull(two & 0xFFFFu, read(7u));
    pull(two >> 16, read(8u));
    pull(floatBitsToUint(read(6u)), read(9u));

    vec2 pairs[7];
    for (uint pair = 0u; pair < 7u; ++pair) pairs[pair] = attribute_pair(pair);
    vec3 offset = vec3(pairs[0], pairs[1].x);
    vec4 turn = vec4(pairs[1].y, pairs[2], pairs[3].x);

    vec3 a = posed[params.first_posed + floatBitsToUint(read(0u))].xyz;
    vec3 ab = posed[params.first_posed + floatBitsToUint(read(1u))].xyz - a;
    vec3 ac = posed[params.first_posed + floatBitsToUint(read(2u))].xyz - a;
    // The triangle's frame: along its first edge, its normal, and what completes them. Collapsed triangles get one too.
    float length_2 = dot(ab, ab);
    vec3 x = length_2 >= LEAST_NORMAL ? ab * inversesqrt(length_2) : vec3(1.0, 0.0, 0.0);
    vec3 z = cross(x, ac);
    length_2 = dot(z, z);
    z = length_2 >= LEAST_NORMAL ? z * inversesqrt(length_2) : across(x);
    vec3 y = cross(z, x);

    PlainGaussian plain;
    vec3 root = vec3(params.root_x, params.root_y, params.root_z);
    plain.position = a + ab * read(3u) + ac * read(4u) + (x * offset.x + y * offset.y + z * offset.z) + root;
    // A sum of quaternions need not have unit length.
    length_2 = dot(turn, turn);
    turn = length_2 > 1e-12 ? turn * inversesqrt(length_2) : vec4(0.0, 0.0, 0.0, 1.0);
    plain.rotation = product(quaternion_of(x, y, z), turn);
    plain.log2_scale = LOG2_E * vec3(pairs[3].y, pairs[4]);
    plain.opacity = 1.0 / (1.0 + exp(-pairs[5].x));
    plain.colour = 0.5 + SH_C0 * vec3(pairs[5].y, pairs[6]);
    states[params.first_state + gaussian] = packed(plain);
}
