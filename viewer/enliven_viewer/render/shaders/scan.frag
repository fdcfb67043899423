// Lit a little, so that colours stay those of the thing; hatched where it was seen little, dark from inside.
#version 330 core
#include "frame.glsl"
uniform vec3 hatch;
in vec3 position;
in vec3 own;
in vec3 normal;
in vec4 tint;
out vec4 colour;

void main() {
    vec3 n = normalize(normal);
    vec3 to_eye = normalize(eye.xyz - position);
    float key = max(dot(n, normalize(to_key.xyz)), 0.0);
    float facing = abs(dot(n, to_eye));
    vec3 lit = tint.rgb * (0.42 + 0.34 * key + 0.24 * facing);
    if (!gl_FrontFacing) {
        lit = vec3(0.13, 0.14, 0.17) * (0.6 + 0.4 * facing);
    } else {
        // Lines 22 mm apart across the thing, as wide as it was seen little.
        float little = 1.0 - smoothstep(0.10, 0.42, tint.a);
        float along = abs(fract((own.x + own.y + own.z) / 0.022) - 0.5) * 2.0;
        float soft = fwidth(along) + 1e-4;
        float line = smoothstep(1.0 - 0.45 * little - soft, 1.0 - 0.45 * little + soft, along);
        lit = mix(lit, mix(lit * 0.55, hatch, 0.75 * line), little);
    }
    colour = vec4(lit, 1.0);
}
