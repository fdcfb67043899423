#version 330 core
#include "frame.glsl"
in vec2 in_place;  // x and z, metres
out vec3 position;
#ifdef SHADED
out vec3 on_light;    // place on the key light's map, 0..1
out vec2 on_contact;  // place on the contact map, 0..1
#endif
invariant gl_Position;

void main() {
    position = vec3(in_place.x, 0.0, in_place.y);
#ifdef SHADED
    on_light = (light_from_world * vec4(position, 1.0)).xyz * 0.5 + 0.5;
    on_contact = (contact_from_world * vec4(position, 1.0)).xy * 0.5 + 0.5;
#endif
    gl_Position = clip_from_world * vec4(position, 1.0);
}
