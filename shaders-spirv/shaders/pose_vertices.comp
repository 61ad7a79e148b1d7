#version 450

// Linear blend skinning: one invocation per vertex of the mesh.

layout(constant_id = 0) const uint GROUP = 64u;
layout(local_size_x_id = 0) in;

layout(push_constant) uniform Params {
    uint vertex_count;
    uint first_row;    // of this state's matrices
    uint first_number; // of this state's canonical vertices
    uint first_posed;  // where this state's posed vertices begin
} params;

// One buffer, seen in two ways: a state's matrices as rows, three a joint; its canonical vertices as three planes.
layout(set = 0, binding = 0, std430) readonly buffer Rows { vec4 rows[]; };
layout(set = 0, binding = 1, std430) readonly buffer Canonical { float canonical[]; };
layout(set = 0, binding = 2, std430) readonly buffer Joints { uint joints[]; };   // four bytes a vertex
layout(set = 0, binding = 3, std430) readonly buffer Weights { vec4 weights[]; };
layout(set = 0, binding = 4, std430) writeonly buffer Posed { vec4 posed[]; };

void main() {
    uint vertex = gl_GlobalInvocationID.x;
    if (vertex >= params.vertex_count) return;
    uint at = params.first_number + vertex;
    vec4 p = vec4(canonical[at], canonical[at + params.vertex_count], canonical[at + 2u * params.vertex_count], 1.0);
    uint named = joints[vertex];
    vec4 weight = weights[vertex];
    vec3 sum = vec3(0.0);
    for (uint k = 0u; k < 4u; ++k) {
        uint row = params.first_row + 3u * ((named >> (8u * k)) & 0xFFu);
        sum += weight[k] * vec3(dot(rows[row], p), dot(rows[row + 1u], p), dot(rows[row + 2u], p));
    }
    posed[params.first_posed + vertex] = vec4(sum, 1.0);
}
