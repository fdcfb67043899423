// One triangle that covers the picture; no buffers.
#version 330 core
out vec2 corner;

void main() {
    corner = vec2((gl_VertexID & 1) * 4 - 1, (gl_VertexID & 2) * 2 - 1);
    gl_Position = vec4(corner, 0.999999, 1.0);
}
