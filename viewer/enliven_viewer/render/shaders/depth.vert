// Depth alone; the same expression as in mesh.vert, so that the same depth comes out.
#version 330 core
#include "frame.glsl"
in vec3 in_position;
invariant gl_Position;

void main() {
    gl_Position = clip_from_world * vec4(in_position, 1.0);
}
