#version 330 core
#include "frame.glsl"
in vec3 in_position;

void main() {
    gl_Position = clip_from_world * vec4(in_position, 1.0);
    gl_Position.z -= 0.002 * gl_Position.w;
}
