// A character with its material: opaque, with holes (MASK), or seen through (BLEND); while REVEALING also
// transparent where the performer's body is inside it. What is then seen through its nearest side is read from
// the picture and not blended, so that it needs no order. A *_MAP stands for its place in the texture.
#version 330 core
#include "light.glsl"
#include "develop.glsl"
#ifdef REVEALING
#include "reveal.glsl"
uniform sampler2D picture;  // what was drawn before
#endif
uniform sampler2D base_map, finish_map, normal_map, occlusion_map, emissive_map;
uniform float normal_scale, occlusion_strength, cutoff;
in vec3 position;
in vec3 normal;
in vec4 uv;
in vec4 albedo;
in vec2 finish;
in vec3 emission;
in float shown;
#ifdef HELD
in vec3 grip;  // light of the performers' hold
#endif
out vec4 colour;

#ifdef NORMAL_MAP
// The normal that a map gives; the axes of the texture follow from how it lies on the screen (Schueler 2013).
vec3 bumped(vec3 n) {
    vec2 at = NORMAL_MAP;
    vec3 px = dFdx(position), py = dFdy(position);
    vec2 ux = dFdx(at), uy = dFdy(at);
    vec3 across = cross(py, n), along = cross(n, px);
    vec3 t = across * ux.x + along * uy.x, b = across * ux.y + along * uy.y;
    float size = inversesqrt(max(max(dot(t, t), dot(b, b)), 1e-30));
    vec3 told = texture(normal_map, at).xyz * 2.0 - 1.0;
    told.xy *= normal_scale;
    return normalize(told.x * size * t - told.y * size * b + max(told.z, 1e-3) * n);
}
#endif

void main() {
    vec4 base = albedo;
#ifdef BASE_MAP
    base *= texture(base_map, BASE_MAP);
#endif
    float cover = 1.0;
#ifdef MASK
    cover = (base.a - cutoff) / max(fwidth(base.a), 1e-3) + 0.5;
    if (cover <= 0.0) discard;
#endif
#ifdef UNLIT
    vec3 light = base.rgb, mirrored = vec3(0.0), n = normalize(normal);
#else
    Surface s = Surface(base.rgb, finish.x, finish.y, 1.0);
#ifdef FINISH_MAP
    vec2 told = texture(finish_map, FINISH_MAP).bg;
    s.metallic *= told.x;
    s.roughness *= told.y;
#endif
#ifdef OCCLUSION_MAP
    s.open = mix(1.0, texture(occlusion_map, OCCLUSION_MAP).r, occlusion_strength);
#endif
    vec3 n = normalize(gl_FrontFacing ? normal : -normal);
#ifdef NORMAL_MAP
    n = bumped(n);
#endif
    vec3 mirrored;
    vec3 light = shaded(s, n, position, mirrored);
#endif
#ifdef EMISSIVE
#ifdef EMISSIVE_MAP
    light += emission * texture(emissive_map, EMISSIVE_MAP).rgb;
#else
    light += emission;
#endif
#endif
#ifdef HELD
    // A tint inside and a bright rim: seen on dark and on light, and the surface stays to be read.
    float rim = 1.0 - abs(dot(n, normalize(eye.xyz - position)));
    float most = max(grip.r, max(grip.g, grip.b));
    light = mix(light, light * grip / max(most, 1e-4), 0.28 * min(most, 1.0));
    light += grip * (0.10 + 1.25 * rim * rim * rim);
#endif
    colour = vec4(developed(light), cover);
#ifdef BLEND
    colour.a = base.a + (1.0 - base.a) * min(max(mirrored.r, max(mirrored.g, mirrored.b)), 1.0);
#endif
#ifdef REVEALING
    float seen = shown;
#ifndef FINE
    seen = opacity(n, position);
#endif
    colour.rgb = mix(texelFetch(picture, ivec2(gl_FragCoord.xy), 0).rgb, colour.rgb, seen);
#endif
}
