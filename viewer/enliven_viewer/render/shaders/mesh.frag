// A character: opaque, but transparent where the performer's body is inside it.
#version 330 core
#include "light.glsl"
#include "develop.glsl"
#include "reveal.glsl"
in vec3 position;
in vec3 normal;
in vec4 surface;
out vec4 colour;

void main() {
#ifdef FINE
    vec4 seen = surface;
#else
    vec3 n = normalize(gl_FrontFacing ? normal : -normal);
    vec4 seen = vec4(lit_surface(surface.rgb, n, position, 0.12), opacity(n, position));
#endif
    colour = vec4(developed(seen.rgb), seen.a);
}
