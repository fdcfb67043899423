// Faces over the picture, a little before where they are, so that they cover the mesh's own.
#version 330 core
#include "frame.glsl"
in vec3 in_position;

void main() {
    gl_Position = clip_from_world * vec4(in_position, 1.0);
    gl_Position.z -= 2e-4 * gl_Position.w;
}
