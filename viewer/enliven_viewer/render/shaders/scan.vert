// A surface that is being scanned.
#version 330 core
#include "frame.glsl"
uniform mat4 world_from_own;
in vec3 in_position;
in vec3 in_normal;
in vec4 in_tint;
out vec3 position;
out vec3 own;
out vec3 normal;
out vec4 tint;

void main() {
    vec4 world = world_from_own * vec4(in_position, 1.0);
    own = in_position;
    position = world.xyz;
    normal = mat3(world_from_own) * in_normal;
    tint = in_tint;
    gl_Position = clip_from_world * world;
}
