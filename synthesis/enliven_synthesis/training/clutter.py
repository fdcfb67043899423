"""Random clutter without people: furniture, pillars, stacks, coat racks, and pieces of walls.

The tracker passes every blob of pixels that may be a person to the network, so the network must recognise
blobs that are not people.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy import ndimage

from enliven.arrays import Bool, Float
from enliven_synthesis.body.rotations import rotation_about_x, rotation_about_y, rotation_about_z

_LEG_RADIUS_M = 0.025
"""Half the thickness in metres of a table leg of ordinary furniture."""
_OUTLINE_SMOOTHING_PX = (3.0, 14.0)
"""Range of the standard deviation in pixels of the Gaussian that smooths the outline of a piece of wall."""


@dataclass(frozen=True)
class ClutterSolid:
    """A box, or the ellipsoid inscribed in it.

    Attributes:
        centre: (3,) metres, world frame.
        half: (3,) half the side lengths, metres.
        turn: (3, 3) world_from_solid.
        round: True if the solid is the ellipsoid.
    """

    centre: Float
    half: Float
    turn: Float
    round: bool = False

    def entry(self, eye: Float, direction: Float) -> Float:
        """Returns the (h, w) ray parameters at which rays enter the solid; infinite if they miss it.

        The rays start at the eye and have the (h, w, 3) ``direction``.
        """
        start = (eye - self.centre) @ self.turn / self.half
        along = direction @ self.turn / self.half
        with np.errstate(divide="ignore", invalid="ignore"):
            enter, leave = _ball_crossings(start, along) if self.round else _cube_crossings(start, along)
        return np.asarray(np.where((enter <= leave) & (enter > 0), enter, np.inf))


def _cube_crossings(start: Float, along: Float) -> tuple[Float, Float]:
    """Returns the parameters at which rays enter and leave the cube from -1 to 1."""
    first, second = (-1.0 - start) / along, (1.0 - start) / along
    return np.nanmax(np.minimum(first, second), -1), np.nanmin(np.maximum(first, second), -1)


def _ball_crossings(start: Float, along: Float) -> tuple[Float, Float]:
    """Returns the parameters at which rays enter and leave the unit ball. They are NaN if a ray misses it."""
    a, b = (along**2).sum(-1), (along * start).sum(-1)
    root = np.sqrt(b**2 - a * ((start**2).sum() - 1.0))
    return (-b - root) / a, (-b + root) / a


def random_clutter(place: Float, rng: Generator) -> list[ClutterSolid]:
    """Returns the solids of a random object, such as furniture, that stands on the floor.

    Args:
        place: (2,) position x and z, metres.
    """
    solids = (_random_stack, _random_pillar, _random_table, _random_rack)[int(rng.integers(4))](rng)
    heading, middle = rotation_about_y(rng.uniform(-np.pi, np.pi)), np.array([place[0], 0.0, place[1]])
    return [ClutterSolid(heading @ s.centre + middle, s.half, heading @ s.turn, s.round) for s in solids]


def _box(low: tuple[float, float, float], high: tuple[float, float, float]) -> ClutterSolid:
    a, b = np.array(low), np.array(high)
    return ClutterSolid(0.5 * (a + b), 0.5 * (b - a), np.eye(3))


def _random_stack(rng: Generator) -> list[ClutterSolid]:
    """Returns boxes and ellipsoids on top of and next to each other."""
    width, height, solids = rng.uniform(0.1, 0.5), rng.uniform(0.3, 2.0), []
    for n in range(int(rng.integers(1, 7))):
        half = rng.uniform(0.04, 0.4, 3)
        turn = (
            rotation_about_y(rng.uniform(-1.6, 1.6))
            @ rotation_about_x(rng.normal(0, 0.3))
            @ rotation_about_z(rng.normal(0, 0.3))
        )
        up = half[1] if n == 0 else rng.uniform(0.0, height)
        centre = np.array([rng.uniform(-width, width), up, rng.uniform(-width, width)])
        solids.append(ClutterSolid(centre, half, turn, bool(rng.random() < 0.4)))
    return solids


def _random_pillar(rng: Generator) -> list[ClutterSolid]:
    """Returns a pillar, a cupboard, a board or an open door."""
    half = np.array([rng.uniform(0.06, 0.5), rng.uniform(0.4, 1.3), rng.uniform(0.01, 0.4)])
    return [ClutterSolid(np.array([0.0, half[1], 0.0]), half, np.eye(3), bool(rng.random() < 0.25))]


def _random_table(rng: Generator) -> list[ClutterSolid]:
    """Returns a table, a stool or a chair, sometimes with an object on it."""
    x, y, z = rng.uniform(0.18, 0.8), rng.uniform(0.3, 1.1), rng.uniform(0.18, 0.5)
    solids = [_box((-x, y - 0.04, -z), (x, y, z))]
    for a, b in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        leg = np.array([a * (x - _LEG_RADIUS_M), 0.5 * y, b * (z - _LEG_RADIUS_M)])
        solids.append(ClutterSolid(leg, np.array([_LEG_RADIUS_M, 0.5 * y, _LEG_RADIUS_M]), np.eye(3)))
    if rng.random() < 0.5:
        solids.append(_box((-x, y, -z), (x, y + rng.uniform(0.2, 0.7), 0.04 - z)))
    if rng.random() < 0.5:
        half = rng.uniform(0.04, 0.25, 3)
        solids.append(
            ClutterSolid(np.array([0.0, y + half[1], 0.0]), half, np.eye(3), bool(rng.random() < 0.5))
        )
    return solids


def _random_rack(rng: Generator) -> list[ClutterSolid]:
    """Returns a pole with arms, a lamp or a coat. It resembles a plant, a coat rack or a tripod."""
    tall = rng.uniform(0.8, 2.1)
    pole = rng.uniform(0.01, 0.05)
    solids = [_box((-pole, 0.0, -pole), (pole, tall, pole))]
    for _ in range(int(rng.integers(0, 6))):
        turn = rotation_about_y(rng.uniform(-np.pi, np.pi)) @ rotation_about_z(rng.uniform(-1.2, 1.2))
        half = np.array([rng.uniform(0.1, 0.45), rng.uniform(0.01, 0.06), rng.uniform(0.01, 0.06)])
        solids.append(ClutterSolid(np.array([0.0, rng.uniform(0.1, tall), 0.0]), half, turn))
    if rng.random() < 0.6:
        half = np.array([rng.uniform(0.1, 0.3), rng.uniform(0.08, 0.5), rng.uniform(0.08, 0.25)])
        solids.append(ClutterSolid(np.array([0.0, tall - half[1], 0.0]), half, np.eye(3), True))
    return solids


def random_wall_piece(shape: tuple[int, int], middle: Float, size: Float, rng: Generator) -> Bool:
    """Returns the (h, w) pixels within a random outline.

    They simulate a piece of a wall that is missing from the background model.

    Args:
        middle, size: (2,) row and column of its middle, and its approximate size in pixels.
    """
    v, u = np.indices(shape)
    down, right = (v - middle[0]) / (0.5 * size[0] + 1.0), (u - middle[1]) / (0.5 * size[1] + 1.0)
    square = rng.random() < 0.4
    away = np.maximum(np.abs(down), np.abs(right)) if square else np.hypot(down, right)
    wander = ndimage.gaussian_filter(rng.normal(size=shape), rng.uniform(*_OUTLINE_SMOOTHING_PX))
    wander *= rng.uniform(0.1, 0.7) / (wander.std() + 1e-9)
    return np.asarray(away + wander < 1.0)
