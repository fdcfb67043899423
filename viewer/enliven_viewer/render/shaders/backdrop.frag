#version 330 core
#include "light.glsl"
#include "develop.glsl"
in vec3 way;
out vec4 colour;

void main() {
    colour = vec4(developed(backdrop(way.y * inversesqrt(dot(way, way)))), 1.0);
}
