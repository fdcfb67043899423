// The performer: lit a little, glowing a little.
#version 330 core
#include "light.glsl"
#include "develop.glsl"
uniform bool hidden;  // drawn where something covers it: flat and faint
in vec3 position;
in vec3 normal;
in vec4 tint;
out vec4 colour;

void main() {
    if (hidden) {
        colour = vec4(developed(tint.rgb * 0.30 * tint.a), 1.0);
        return;
    }
    vec3 n = normalize(normal);
    float facing = max(dot(n, normalize(eye.xyz - position)), 0.0);
    float wrap = 0.5 + 0.5 * dot(n, to_key.xyz);
    vec3 light = tint.rgb * (0.30 + 0.55 * wrap * wrap + 0.55 * pow(1.0 - facing, 2.5));
    float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
    colour = vec4(developed(light), tint.a + (noise - 0.5) * 0.24 * step(tint.a, 0.99));
}
