// The floor: a pool of light, a half-metre grid, soft shadow and contact where it is SHADED, lost in the horizon.
#version 330 core
#include "light.glsl"
#include "develop.glsl"
in vec3 position;
#ifdef SHADED
in vec3 on_light;
in vec2 on_contact;
#endif
out vec4 colour;

// Cover of lines every `spacing` metres, `width` metres wide, never sharper than a pixel.
float lines(vec2 p, vec2 pixel, float spacing, float width) {
    vec2 away = abs(fract(p / spacing - 0.5) - 0.5) * spacing;
    vec2 cover = clamp((0.5 * max(vec2(width), pixel) + 0.5 * pixel - away) / pixel, 0.0, 1.0);
    cover *= min(width / pixel, 1.0);
    return max(cover.x, cover.y);
}

void main() {
    vec2 off = position.xz - stage.xz;
    float far = dot(off, off) / (stage.w * stage.w);
    float near = 1.0 - smoothstep(0.5, 9.0, far);
    vec2 pixel = fwidth(position.xz);
    float grid = ground.a * (0.045 * lines(position.xz, pixel, 0.5, 0.006) + 0.070 * lines(position.xz, pixel, 1.0, 0.010));
    vec3 albedo = ground.rgb + grid;
    float pool = mix(1.0, 1.0 / (1.0 + 0.35 * far * far), zenith.a);
#ifdef SHADED
    float visible = key_visibility_at(on_light);
    float open = 1.0 - 0.75 * floor_contact_at(on_contact);
#else
    const float visible = 1.0, open = 1.0;
#endif
    float key = to_key.y * visible * pool;
    vec3 lit = albedo * (key_light.rgb * key * 0.52 + sky_light.rgb * open * 0.62) * mix(1.0, open, 0.35);
    vec3 light = mix(horizon.rgb, lit, near);
    colour = vec4(developed(light), 1.0);
}
