// From light to the pixel; needs frame.glsl.
// Vignette, the filmic curve of Hejl and Burgess-Dawson (2010), which contains the display's gamma and costs
// one division, and a dither against banding.
vec3 developed(vec3 light) {
    vec2 q = gl_FragCoord.xy / viewport.xy - 0.5;
    light *= 0.98 - 0.72 * dot(q, q);
    light = max(light - 0.002, 0.0);
    vec3 film = light * (6.2 * light + 0.5) / (light * (6.2 * light + 1.7) + 0.06);
    float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
    return film + (noise - 0.5) / 255.0;
}
