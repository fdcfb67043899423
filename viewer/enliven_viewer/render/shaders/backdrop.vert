// One triangle that covers the picture, and the way from the eye through each of its corners; no buffers.
#version 330 core
#include "frame.glsl"
out vec3 way;  // of any length

void main() {
    vec2 corner = vec2((gl_VertexID & 1) * 4 - 1, (gl_VertexID & 2) * 2 - 1);
    vec4 far = world_from_clip * vec4(corner, 1.0, 1.0);
    way = far.xyz / far.w - eye.xyz;
    gl_Position = vec4(corner, 0.999999, 1.0);
}
