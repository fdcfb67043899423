// A skinned vertex. On a FINE closed mesh light and opacity are taken here and not at every pixel: vertices
// are then closer together than anything that shadow or transparency could show.
#version 330 core
#include "light.glsl"
#include "reveal.glsl"
in vec3 in_position;
in vec3 in_normal;
in vec3 in_albedo;
out vec3 position;
out vec3 normal;
out vec4 surface;  // albedo; or light and opacity where fine
invariant gl_Position;

void main() {
    position = in_position;
    normal = in_normal;
#ifdef FINE
    surface = vec4(lit_surface(in_albedo, in_normal, in_position, 0.12), opacity(in_normal, in_position));
#else
    surface = vec4(in_albedo, 1.0);
#endif
    gl_Position = clip_from_world * vec4(in_position, 1.0);
}
