// An edge or a node of a graph: a capsule whose depth is taken nearer to the eye than it is.
#version 330 core
#include "frame.glsl"
in vec3 in_direction;  // on the unit sphere, axis +Y
in float in_end;       // 0 at the first ball, 1 at the second
in vec4 in_from;       // xyz metres, w radius
in vec4 in_to;         // xyz metres, w radius
in vec4 in_tint;       // rgb linear, a opacity
uniform float bias;    // metres towards the eye
out vec3 position;
out vec3 normal;
out vec4 tint;

void main() {
    vec3 along = in_to.xyz - in_from.xyz;
    float size = length(along);
    vec3 y = size > 1e-6 ? along / size : vec3(0.0, 1.0, 0.0);
    vec3 x = normalize(cross(y, abs(y.x) < 0.8 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 0.0, 1.0)));
    normal = mat3(x, y, cross(x, y)) * in_direction;
    position = mix(in_from.xyz, in_to.xyz, in_end) + mix(in_from.w, in_to.w, in_end) * normal;
    tint = in_tint;
    vec4 seen = clip_from_world * vec4(position, 1.0);
    vec4 nearer = clip_from_world * vec4(position + bias * normalize(eye.xyz - position), 1.0);
    gl_Position = vec4(seen.xy, nearer.z / nearer.w * seen.w, seen.w);
}
