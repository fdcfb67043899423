// What is painted over a mesh, a little before where it is, so that it covers the mesh's own faces.
#version 330 core
#include "frame.glsl"
in vec3 in_position;
in vec4 in_tint;
out vec4 tint;

void main() {
    tint = in_tint;
    gl_Position = clip_from_world * vec4(in_position, 1.0);
    gl_Position.z -= 2e-4 * gl_Position.w;
}
