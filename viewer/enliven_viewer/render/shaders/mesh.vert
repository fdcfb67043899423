// A skinned vertex with its paint. On a FINE closed mesh opacity is taken here and not at every pixel: vertices
// are then closer together than anything that transparency could show.
#version 330 core
#include "frame.glsl"
#ifdef REVEALING
#include "reveal.glsl"
#endif
in vec3 in_position;
in vec3 in_normal;
in vec4 in_uv;
in vec4 in_albedo;
in vec2 in_finish;
in vec3 in_emission;
#ifdef HELD
#include "grip.glsl"
out vec3 grip;
#endif
out vec3 position;
out vec3 normal;
out vec4 uv;        // two places in textures
out vec4 albedo;    // linear, and opacity
out vec2 finish;    // metallic, roughness
out vec3 emission;
out float shown;

void main() {
    position = in_position;
    normal = in_normal;
    uv = in_uv;
    albedo = in_albedo;
    finish = in_finish;
    emission = in_emission;
    shown = 1.0;
#ifdef HELD
    grip = held_light();
#endif
#if defined(FINE) && defined(REVEALING)
    shown = opacity(in_normal, in_position);
#endif
    gl_Position = clip_from_world * vec4(in_position, 1.0);
}
