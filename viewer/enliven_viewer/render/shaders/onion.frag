// Seen at its edges, as glass is, and a little all over; not developed, so that its colour stays what it means.
#version 330 core
#include "frame.glsl"
uniform vec3 tint;
uniform float opacity;
in vec3 position;
in vec3 normal;
out vec4 colour;

void main() {
    float facing = abs(dot(normalize(normal), normalize(eye.xyz - position)));
    float edge = pow(1.0 - facing, 1.6);
    colour = vec4(mix(tint * 0.75, min(tint * 1.15, vec3(1.0)), edge), opacity * mix(0.12, 0.85, edge));
}
