// Lit a little and not developed, so that colours stay those of the legend.
#version 330 core
#include "frame.glsl"
in vec3 position;
in vec3 normal;
in vec4 tint;
out vec4 colour;

void main() {
    vec3 n = normalize(normal);
    float facing = max(dot(n, normalize(eye.xyz - position)), 0.0);
    colour = vec4(pow(tint.rgb * mix(0.55, 1.0, facing), vec3(1.0 / 2.2)), tint.a);
}
