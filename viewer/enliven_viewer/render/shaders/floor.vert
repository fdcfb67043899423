#version 330 core
#include "frame.glsl"
in vec2 in_corner;
uniform float reach;
out vec3 position;
out vec3 on_light;    // place on the key light's map, 0..1
out vec2 on_contact;  // place on the contact map, 0..1

void main() {
    position = vec3(stage.x + reach * in_corner.x, 0.0, stage.z + reach * in_corner.y);
    on_light = (light_from_world * vec4(position, 1.0)).xyz * 0.5 + 0.5;
    on_contact = (contact_from_world * vec4(position, 1.0)).xy * 0.5 + 0.5;
    gl_Position = clip_from_world * vec4(position, 1.0);
}
