// A loose thing in the light of the studio.
#version 330 core
#include "light.glsl"
#include "develop.glsl"
in vec3 position;
in vec3 normal;
in vec3 albedo;
out vec4 colour;

void main() {
    colour = vec4(developed(lit_surface(albedo, normalize(normal), position, 0.10)), 1.0);
}
