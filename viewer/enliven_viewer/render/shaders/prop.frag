// A loose thing in the light of the studio.
#version 330 core
#include "light.glsl"
#include "develop.glsl"
in vec3 position;
in vec3 normal;
in vec3 albedo;
out vec4 colour;

void main() {
    vec3 mirrored;
    Surface painted = Surface(albedo, 0.0, 0.5, 1.0);
    colour = vec4(developed(shaded(painted, normalize(normal), position, mirrored)), 1.0);
}
