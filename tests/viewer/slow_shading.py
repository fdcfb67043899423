"""Computes the lighting of shaders/light.glsl and the tone curve of shaders/develop.glsl for one point,
slowly.
"""

from __future__ import annotations

import numpy as np

from enliven_viewer.render.stage_look import LOOKS, find_key_direction
from enliven_viewer.settings import RenderSettings


def smoothstep(low: float, high: float, x: float) -> float:
    t = min(max((x - low) / (high - low), 0.0), 1.0)
    return t * t * (3 - 2 * t)


def mix(a, b, t):
    return np.asarray(a) * (1 - t) + np.asarray(b) * t


def unit(v):
    return np.asarray(v) / np.linalg.norm(v)


def surroundings(way, roughness: float, settings: RenderSettings):
    look, key = LOOKS[settings.look], find_key_direction(settings)
    sky, soft, boxes = np.array(look.sky), 0.05 + 0.95 * roughness, 1 - 0.8 * roughness
    light = mix(look.bounce, sky, smoothstep(-soft, soft, way[1]))
    light = light + 1.6 * boxes * sky * smoothstep(0.7 - soft, 0.7 + soft, way[1])
    behind = unit([-key[0], 0.45, -key[2]])
    light = light + 1.2 * boxes * np.array(look.rim) * smoothstep(0.8 - soft, 0.8 + soft, way @ behind)
    return light + 0.25 * boxes * np.array(look.key) * smoothstep(0.9 - soft, 0.9 + soft, way @ key)


def shaded(albedo, metallic, roughness, n, p, eye, settings: RenderSettings):
    """Returns the (3,) light towards the eye from a point that the key light reaches."""
    look, to_light = LOOKS[settings.look], find_key_direction(settings)
    albedo, roughness = np.asarray(albedo), min(max(roughness, 0.09), 1.0)
    v = unit(np.asarray(eye) - p)
    facing, key = min(max(n @ v, 1e-3), 1.0), max(n @ to_light, 0.0)
    low = mix(0.45, 1.0, smoothstep(-0.02, 0.45, p[1] + 0.3 * n[1]))
    a = roughness**2
    straight = mix(np.full(3, 0.04), albedo, metallic)
    h = unit(v + to_light)
    spread = max(n @ h, 0.0) ** 2 * (a * a - 1) + 1
    lobe = a * a / (np.pi * spread**2)
    smith = 0.5 / mix(2 * key * facing, key + facing, a)
    fresnel = straight + (1 - straight) * (1 - max(v @ h, 0.0)) ** 5
    glint = fresnel * min(lobe * smith, 40.0) * key * np.array(look.key)
    r = roughness * np.array([-1, -0.0275, -0.572, 0.022]) + np.array([1, 0.0425, 1.04, -0.04])
    share = min(r[0] ** 2, 2 ** (-9.28 * facing)) * r[0] + r[1]
    mirror = straight * (-1.04 * share + r[2]) + 1.04 * share + r[3]
    mirrored = glint + mirror * surroundings(2 * (n @ v) * n - v, roughness, settings) * low
    ambient = mix(look.bounce, look.sky, 0.5 + 0.5 * n[1]) * low
    flat = np.array([to_light[0], 0.0, to_light[2]])
    rim = np.array(look.rim) * (1 - facing) ** 4 * max(0.35 - 0.65 * (n @ flat), 0.0)
    return (1 - metallic) * albedo * (np.array(look.key) * key * 0.318 + ambient) + mirrored + rim


def developed(light, at, size):
    """Returns the (3,) colour 0..1 of a pixel, without the dither."""
    q = (np.asarray(at) + 0.5) / size - 0.5
    light = np.maximum(light * (0.98 - 0.72 * (q @ q)) - 0.002, 0.0)
    return light * (6.2 * light + 0.5) / (light * (6.2 * light + 1.7) + 0.06)
