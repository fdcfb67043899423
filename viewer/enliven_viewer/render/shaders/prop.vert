// A loose thing, one an instance: a box with bevelled edges; a ball is one whose bevel is all of it.
#version 330 core
#include "frame.glsl"
in vec3 in_direction;  // unit, from the middle of the bevel's ball
in vec3 in_corner;     // -1 or 1: which of the eight balls in the corners
in vec4 in_place;      // xyz metres, w bevel in metres
in vec4 in_turn;       // unit quaternion x, y, z, w
in vec3 in_half;       // half edges in metres
in vec3 in_albedo;     // rgb linear
out vec3 position;
out vec3 normal;
out vec3 albedo;
out float height;
out float solid;
uniform bool casting;
uniform mat4 clip_from_caster;

vec3 turned(vec3 v) {
    return v + 2.0 * cross(in_turn.xyz, cross(in_turn.xyz, v) + in_turn.w * v);
}

void main() {
    vec3 local = in_corner * (in_half - in_place.w) + in_place.w * in_direction;
    normal = turned(in_direction);
    position = in_place.xyz + turned(local);
    albedo = in_albedo;
    height = position.y;
    solid = 1.0;
    gl_Position = (casting ? clip_from_caster : clip_from_world) * vec4(position, 1.0);
}
