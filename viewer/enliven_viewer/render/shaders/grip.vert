// The outline of what is held: the mesh's far side, some pixels larger than the mesh.
#version 330 core
#include "frame.glsl"
#include "grip.glsl"
uniform float pixels;
in vec3 in_position;
in vec3 in_normal;
out vec3 grip;

void main() {
    grip = held_light();
    gl_Position = clip_from_world * vec4(in_position, 1.0);
    vec2 way = (clip_from_world * vec4(in_normal, 0.0)).xy * viewport.xy;
    gl_Position.xy += way / max(length(way), 1e-6) * pixels * 2.0 / viewport.xy * gl_Position.w;
}
