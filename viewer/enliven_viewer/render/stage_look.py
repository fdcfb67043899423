"""The looks of a stage by name. A look is a preset of light, backdrop and floor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven_viewer.settings import LookName, RenderSettings

Light = tuple[float, float, float]
"""A light colour in linear red, green and blue. 1 is the brightness of a white wall in the sun."""
_MAX_BACKDROP_WHITE = 0.97
"""Maximum value of white in a backdrop, because the filmic tone curve never quite reaches 1."""


@dataclass(frozen=True)
class StageLook:
    """The lighting of a stage.

    Attributes:
        key, sky, bounce, rim: key light, light from above, from below, and from behind.
        horizon, zenith: backdrop colours at eye level and above. The floor fades into the horizon.
        floor: colour of the floor.
        grid: strength of the lines on the floor; negative for lines darker than the floor.
        pool: darkening of the floor away from the centre, 0 (none) to 1.
    """

    key: Light
    sky: Light
    bounce: Light
    rim: Light
    horizon: Light
    zenith: Light
    floor: Light
    grid: float = 1.0
    pool: float = 1.0


LOOKS: dict[LookName, StageLook] = {
    "studio": StageLook(
        key=(3.05, 2.74, 2.34),
        sky=(0.34, 0.41, 0.56),
        bounce=(0.26, 0.22, 0.20),
        rim=(0.38, 0.50, 0.74),
        horizon=(0.058, 0.066, 0.088),
        zenith=(0.006, 0.0075, 0.0125),
        floor=(0.122, 0.122, 0.130),
    ),
    "bright": StageLook(
        key=(2.40, 2.30, 2.16),
        sky=(0.46, 0.48, 0.52),
        bounce=(0.30, 0.29, 0.28),
        rim=(0.10, 0.12, 0.16),
        horizon=(0.70, 0.71, 0.74),
        zenith=(0.50, 0.53, 0.60),
        floor=(0.62, 0.62, 0.63),
        grid=-2.2,
        pool=0.15,
    ),
    "night": StageLook(
        key=(3.30, 2.72, 1.98),
        sky=(0.10, 0.13, 0.22),
        bounce=(0.075, 0.060, 0.055),
        rim=(0.85, 1.05, 1.75),
        horizon=(0.0048, 0.0056, 0.0090),
        zenith=(0.0010, 0.0012, 0.0022),
        floor=(0.050, 0.050, 0.056),
        grid=0.0,
    ),
    "white": StageLook(
        key=(2.20, 2.14, 2.04),
        sky=(0.40, 0.42, 0.46),
        bounce=(0.30, 0.30, 0.29),
        rim=(0.04, 0.05, 0.06),
        horizon=(1.62, 1.63, 1.66),
        zenith=(1.20, 1.22, 1.27),
        floor=(1.36, 1.37, 1.40),
        grid=0.0,
        pool=0.0,
    ),
    "dawn": StageLook(
        key=(3.40, 2.20, 1.38),
        sky=(0.38, 0.36, 0.56),
        bounce=(0.34, 0.22, 0.18),
        rim=(0.95, 0.48, 0.46),
        horizon=(0.62, 0.30, 0.20),
        zenith=(0.075, 0.070, 0.160),
        floor=(0.170, 0.130, 0.120),
        grid=0.0,
        pool=0.25,
    ),
    "garden": StageLook(
        key=(3.30, 3.10, 2.60),
        sky=(0.50, 0.64, 0.86),
        bounce=(0.26, 0.30, 0.17),
        rim=(0.42, 0.52, 0.62),
        horizon=(0.62, 0.74, 0.84),
        zenith=(0.13, 0.28, 0.58),
        floor=(0.150, 0.185, 0.085),
        grid=0.0,
        pool=0.1,
    ),
}
"""The looks: a dark studio, a bright studio, a spotlight at night, a white background, dawn, and a garden."""


def find_key_direction(settings: RenderSettings) -> Float:
    """Returns the (3,) unit direction towards the key light."""
    around, up = math.radians(settings.light_around), math.radians(settings.light_up)
    level = math.cos(up)
    return np.array([math.sin(around) * level, math.sin(up), math.cos(around) * level])


def make_look_rows(look: StageLook, settings: RenderSettings) -> Float:
    """Returns (7, 4): the vectors of the uniform block Frame for a look."""
    bright = settings.brightness
    lights = [look.key, look.sky, look.bounce, look.rim, look.horizon, look.zenith, look.floor]
    rows = np.zeros((7, 4))
    rows[:, :3] = lights
    rows[:6, :3] *= bright
    rows[5, 3] = look.pool
    rows[6, 3] = look.grid if settings.grid else 0.0
    if settings.backdrop:
        rows[4:6, :3] = light_from_colour(settings.backdrop)
    return rows


def light_from_colour(colour: str) -> Float:
    """Returns the linear light (3,) that is displayed as a colour such as "#22334a".

    It inverts the filmic tone curve of shaders/develop.glsl.
    """
    srgb = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    y = np.minimum(srgb, _MAX_BACKDROP_WHITE)
    a, b, c = 6.2 * (1 - y), 0.5 - 1.7 * y, -0.06 * y
    return np.asarray((np.sqrt(b * b - 4 * a * c) - b) / (2 * a))
