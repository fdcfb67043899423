// What every shader of a frame shares; written once a frame by renderer.py in the same order.
layout(std140) uniform Frame {
    mat4 clip_from_world;
    mat4 world_from_clip;
    mat4 light_from_world;
    mat4 contact_from_world;
    vec4 eye;       // xyz metres
    vec4 to_key;    // xyz unit direction towards the key light
    vec4 stage;     // xyz centre of the pool of light on the floor, w its radius in metres
    vec4 viewport;  // xy pixels
    vec4 key_light;     // linear rgb, as are all below
    vec4 sky_light;     // from above
    vec4 bounce_light;  // from below
    vec4 rim_light;     // from behind
    vec4 horizon;
    vec4 zenith;        // a: how much darker the floor is away from the middle
    vec4 ground;        // rgb of the floor's paint, a strength of its grid
};
