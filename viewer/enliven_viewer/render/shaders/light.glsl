// Studio light: a warm key with a soft shadow, a cool sky, bounce from the floor, and a rim from behind.
#include "frame.glsl"
uniform sampler2D shadow_map;
uniform sampler2D contact_map;

const vec3 KEY = vec3(3.05, 2.74, 2.34);
const vec3 SKY = vec3(0.34, 0.41, 0.56);
const vec3 BOUNCE = vec3(0.26, 0.22, 0.20);
const vec3 RIM = vec3(0.38, 0.50, 0.74);
const vec3 HORIZON = vec3(0.058, 0.066, 0.088);
const vec3 ZENITH = vec3(0.006, 0.0075, 0.0125);

// Share of the key light that arrives at a point of the map (0..1 each): variance shadow map, Chebyshev's
// bound, the light that it lets bleed through cut off.
float key_visibility_at(vec3 s) {
    vec2 inside = clamp(min(s.xy, 1.0 - s.xy) * 50.0, 0.0, 1.0);
    float cover = inside.x * inside.y;
    float visible = 1.0;
    if (cover > 0.0) {
        vec2 moments = textureLod(shadow_map, s.xy, 0.0).rg;
        float variance = max(moments.y - moments.x * moments.x, 1.5e-5);
        float behind = max(min(s.z, 1.0) - moments.x - 0.004, 0.0);
        float lit = variance / (variance + behind * behind);
        visible = mix(1.0, clamp((lit - 0.22) / 0.78, 0.0, 1.0), cover);
    }
    return visible;
}

float key_visibility(vec3 p) {
    return key_visibility_at((light_from_world * vec4(p, 1.0)).xyz * 0.5 + 0.5);
}

// How much something close above hides the sky from a point of the floor, by its place on the map (0..1).
float floor_contact_at(vec2 s) {
    vec2 inside = clamp(min(s, 1.0 - s) * 25.0, 0.0, 1.0);
    float cover = inside.x * inside.y;
    return cover > 0.0 ? cover * textureLod(contact_map, s, 0.0).r : 0.0;
}

// What is far away; `up` is the sine of the angle above the horizon.
vec3 backdrop(float up) {
    up = max(up, 0.0);
    return mix(HORIZON, ZENITH, up / (up + 0.24));
}

vec3 lit_surface(vec3 albedo, vec3 n, vec3 p, float gloss) {
    vec3 v = normalize(eye.xyz - p);
    float facing = max(dot(n, v), 0.0);
    float key = max(dot(n, to_key.xyz), 0.0) * key_visibility(p + n * 0.012);
    float low = mix(0.45, 1.0, smoothstep(-0.02, 0.45, p.y + 0.3 * n.y));
    vec3 ambient = mix(BOUNCE, SKY, 0.5 + 0.5 * n.y) * low;
    float edge = (1.0 - facing) * (1.0 - facing);
    vec3 rim = RIM * edge * edge * max(0.35 - 0.65 * dot(n, vec3(to_key.x, 0.0, to_key.z)), 0.0);
    float aligned = max(dot(n, normalize(v + to_key.xyz)), 0.0);
    float shine = gloss * exp2(-90.0 * (1.0 - aligned)) * min(key * 4.0, 1.0);
    return albedo * (KEY * key * 0.318 + ambient) + rim + vec3(shine);
}
