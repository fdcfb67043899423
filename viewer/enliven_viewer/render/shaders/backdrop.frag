#version 330 core
#include "light.glsl"
#include "develop.glsl"
in vec2 corner;
out vec4 colour;

void main() {
    vec4 far = world_from_clip * vec4(corner, 1.0, 1.0);
    colour = vec4(developed(backdrop(normalize(far.xyz / far.w - eye.xyz))), 1.0);
}
