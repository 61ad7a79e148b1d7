#version 450
// One triangle over all of the picture.

void main() {
    vec2 corner = vec2((gl_VertexIndex & 1) == 0 ? -1.0 : 3.0, (gl_VertexIndex & 2) == 0 ? -1.0 : 3.0);
    gl_Position = vec4(corner, 0.5, 1.0);
}
