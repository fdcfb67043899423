// A skinned vertex. On a FINE closed mesh light and opacity are taken here and not at every pixel: vertices
// are then closer together than anything that shadow or transparency could show.
#version 330 core
#include "light.glsl"
#ifdef REVEALING
#include "reveal.glsl"
#endif
in vec3 in_position;
in vec3 in_normal;
in vec3 in_albedo;
out vec3 position;
out vec3 normal;
out vec4 surface;  // albedo; or light and opacity where fine

void main() {
    position = in_position;
    normal = in_normal;
    surface = vec4(in_albedo, 1.0);
#ifdef FINE
    surface.rgb = lit_surface(in_albedo, in_normal, in_position, 0.12);
#ifdef REVEALING
    surface.a = opacity(in_normal, in_position);
#endif
#endif
    gl_Position = clip_from_world * vec4(in_position, 1.0);
}
