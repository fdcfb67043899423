// A character: opaque, but while REVEALING transparent where the performer's body is inside it. What is then
// seen through its nearest side is read from the picture and not blended, so that it needs no order.
#version 330 core
#include "light.glsl"
#include "develop.glsl"
#ifdef REVEALING
#include "reveal.glsl"
uniform sampler2D picture;  // what was drawn before
#endif
in vec3 position;
in vec3 normal;
in vec4 surface;
out vec4 colour;

void main() {
    vec4 seen = surface;
#ifndef FINE
    vec3 n = normalize(gl_FrontFacing ? normal : -normal);
    seen.rgb = lit_surface(surface.rgb, n, position, 0.12);
#ifdef REVEALING
    seen.a = opacity(n, position);
#endif
#endif
    colour = vec4(developed(seen.rgb), 1.0);
#ifdef REVEALING
    colour.rgb = mix(texelFetch(picture, ivec2(gl_FragCoord.xy), 0).rgb, colour.rgb, seen.a);
#endif
}
