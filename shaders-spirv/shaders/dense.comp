#version 450

// Fully connected layers, many beside one another: y = x W + b, then SiLU where it is asked for. One invocation for two outputs of
// one layer. Weights are halves, two neighbouring outputs in a word: neighbouring invocations read neighbouring words, and all of a
// layer read the same input.

layout(constant_id = 0) const uint GROUP = 64u;
layout(constant_id = 1) const bool SILU = false;
layout(local_size_x_id = 0) in;

layout(push_constant) uniform Params {
    uint layers;
    uint inputs;       // of a layer
    uint pairs;        // of its outputs
    uint first_input;  // where the first layer's inputs are in `x` ...
    uint input_stride; // ... and how far the next one's are from there: 0 where all have the same
    uint first_output; // where the outputs go in `y`, in pairs
} params;

layout(set = 0, binding = 0, std430) readonly buffer Weights { uint weights[]; }; // [layers, inputs, pairs], two halves each
layout(set = 0, binding = 1, std430) readonly buffer Bias { vec2 bias[]; };       // [layers, pairs]
layout(set = 0, binding = 2, std430) readonly buffer Inputs { float x[]; };
layout(set = 0, binding = 3, std430) writeonly buffer Outputs { vec2 y[]; };      // [layers, pairs]

void main() {
    uint at = gl_GlobalInvocationID.x;
    if (at >= params.layers * params.pairs) return;
    uint layer = at / params.pairs;
    uint weight = layer * params.inputs * params.pairs + at % params.pairs;
    uint from = params.first_input + layer * params.input_stride;
    vec2 sum = bias[at];
    // Four at a time: with so few invocations, reads must be under way together.
    uint i = 0u;
    for (; i + 4u <= params.inputs; i += 4u) {
        uvec4 words = uvec4(weights[weight], weights[weight + params.pairs],
                            weights[weight + 2u * params.pairs], weights[weight + 3u * params.pairs]);
        vec4 inputs = vec4(x[from + i], x[from + i + 1u], x[from + i + 2u], x[from + i + 3u]);
        sum += inputs.x * unpackHalf2x16(words.x) + inputs.y * unpackHalf2x16(words.y)
             + inputs.z * unpackHalf2x16(words.z) + inputs.w * unpackHalf2x16(words.w);
        weight += 4u * params.pairs;
    }
    for (; i < params.inputs; ++i) {
        sum += x[from + i] * unpackHalf2x16(weights[weight]);
        weight += params.pairs;
    }
    if (SILU) sum /= 1.0 + exp(-sum);
    y[params.first_output + at] = sum;
}
