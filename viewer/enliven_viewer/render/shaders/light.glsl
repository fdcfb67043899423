// The light of a look: a key with a soft shadow, a sky, bounce from the floor, and a rim from behind.
#include "frame.glsl"
uniform sampler2D shadow_map;
uniform sampler2D contact_map;

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
    return mix(horizon.rgb, zenith.rgb, up / (up + 0.24));
}

struct Surface {
    vec3 albedo;
    float metallic;
    float roughness;
    float open;  // share of the sky that reaches it
};

// What a mirror shows of the studio in a direction: sky over floor, a soft box above, a strip behind, and the
// key's own box; the rougher the mirror, the softer their edges.
vec3 surroundings(vec3 way, float roughness) {
    float soft = 0.05 + 0.95 * roughness;
    vec3 light = mix(bounce_light.rgb, sky_light.rgb, smoothstep(-soft, soft, way.y));
    float boxes = 1.0 - 0.8 * roughness;
    light += 1.6 * boxes * sky_light.rgb * smoothstep(0.70 - soft, 0.70 + soft, way.y);
    vec3 behind = normalize(vec3(-to_key.x, 0.45, -to_key.z));
    light += 1.2 * boxes * rim_light.rgb * smoothstep(0.80 - soft, 0.80 + soft, dot(way, behind));
    return light + 0.25 * boxes * key_light.rgb * smoothstep(0.90 - soft, 0.90 + soft, dot(way, to_key.xyz));
}

// Share of the surroundings that a surface mirrors, for its reflectance straight on (Karis 2014).
vec3 mirrored_share(vec3 straight, float roughness, float facing) {
    vec4 r = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float a = min(r.x * r.x, exp2(-9.28 * facing)) * r.x + r.y;
    return straight * (-1.04 * a + r.z) + (1.04 * a + r.w);
}

// Light that leaves a surface towards the eye: Lambert under the key and the sky, GGX with Schlick's Fresnel
// and Smith's shadowing (Hammon's fit) under the key, the mirrored surroundings, and a rim for the outline.
// `mirrored` is what of it was mirrored: glass shows that too.
vec3 shaded(Surface s, vec3 n, vec3 p, out vec3 mirrored) {
    vec3 v = normalize(eye.xyz - p);
    float facing = clamp(dot(n, v), 1e-3, 1.0);
    float key = max(dot(n, to_key.xyz), 0.0);
    float visible = key > 0.0 ? key_visibility(p + n * 0.012) : 0.0;
    float low = mix(0.45, 1.0, smoothstep(-0.02, 0.45, p.y + 0.3 * n.y)) * s.open;

    float roughness = clamp(s.roughness, 0.09, 1.0);
    float a = roughness * roughness;
    vec3 straight = mix(vec3(0.04), s.albedo, s.metallic);
    vec3 h = normalize(v + to_key.xyz);
    float nh = max(dot(n, h), 0.0);
    float spread = nh * nh * (a * a - 1.0) + 1.0;
    float lobe = a * a / (3.14159265 * spread * spread);
    float smith = 0.5 / mix(2.0 * key * facing, key + facing, a);
    float away = 1.0 - max(dot(v, h), 0.0);
    vec3 fresnel = straight + (1.0 - straight) * (away * away) * (away * away) * away;
    vec3 glint = fresnel * min(lobe * smith, 40.0) * key * visible * key_light.rgb;

    vec3 around = surroundings(reflect(-v, n), roughness) * low;
    mirrored = glint + mirrored_share(straight, roughness, facing) * around;

    vec3 ambient = mix(bounce_light.rgb, sky_light.rgb, 0.5 + 0.5 * n.y) * low;
    float edge = (1.0 - facing) * (1.0 - facing);
    vec3 rim = rim_light.rgb * edge * edge * max(0.35 - 0.65 * dot(n, vec3(to_key.x, 0.0, to_key.z)), 0.0);
    vec3 matt = (1.0 - s.metallic) * s.albedo;
    return matt * (key_light.rgb * key * visible * 0.318 + ambient) + mirrored + rim;
}
