// A mesh whose outline is wanted: how far its nearest side is before the eye.
#version 330 core
#include "frame.glsl"
in vec3 in_position;
out float away;

void main() {
    gl_Position = clip_from_world * vec4(in_position, 1.0);
    away = gl_Position.w;
}
