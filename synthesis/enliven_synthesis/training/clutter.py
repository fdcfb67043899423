"""What is no person, by dice: furniture, pillars, stacks, racks with a coat on them, and pieces of walls.

A tracker hands over any group of pixels that may be somebody; the network is to say when it is not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from enliven.arrays import Bool, Float
from enliven_synthesis.body import about_x, about_y, about_z

Dice = np.random.Generator

_LEG = 0.025
"""Metres: half of what a table's leg is thick."""
_PATCHY = (3.0, 14.0)
"""Pixels over which the outline of a piece of wall wanders."""


@dataclass(frozen=True)
class Solid:
    """A box, or the ellipsoid in it.

    Attributes:
        centre: (3,) metres, world frame.
        half: (3,) metres, half its sides.
        turn: (3, 3) world_from_solid.
        round: whether it is the ellipsoid.
    """

    centre: Float
    half: Float
    turn: Float
    round: bool = False

    def entry(self, eye: Float, direction: Float) -> Float:
        """(h, w) how many (h, w, 3) ``direction`` it is from the eye to where rays enter; inf: they miss."""
        start = (eye - self.centre) @ self.turn / self.half
        along = direction @ self.turn / self.half
        with np.errstate(divide="ignore", invalid="ignore"):
            enter, leave = _in_ball(start, along) if self.round else _in_cube(start, along)
        return np.asarray(np.where((enter <= leave) & (enter > 0), enter, np.inf))


def _in_cube(start: Float, along: Float) -> tuple[Float, Float]:
    """Where rays enter and leave the cube from -1 to 1."""
    one, other = (-1.0 - start) / along, (1.0 - start) / along
    return np.nanmax(np.minimum(one, other), -1), np.nanmin(np.maximum(one, other), -1)


def _in_ball(start: Float, along: Float) -> tuple[Float, Float]:
    """Where rays enter and leave the unit ball; not a number where they miss it."""
    a, b = (along**2).sum(-1), (along * start).sum(-1)
    root = np.sqrt(b**2 - a * ((start**2).sum() - 1.0))
    return (-b - root) / a, (-b + root) / a


def random_thing(place: Float, dice: Dice) -> list[Solid]:
    """Something that stands at a place on the floor.

    Args:
        place: (2,) metres, x and z.
    """
    made = (_stack, _pillar, _table, _rack)[int(dice.integers(4))](dice)
    heading, middle = about_y(dice.uniform(-np.pi, np.pi)), np.array([place[0], 0.0, place[1]])
    return [Solid(heading @ s.centre + middle, s.half, heading @ s.turn, s.round) for s in made]


def _box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Solid:
    a, b = np.array(low), np.array(high)
    return Solid(0.5 * (a + b), 0.5 * (b - a), np.eye(3))


def _stack(dice: Dice) -> list[Solid]:
    """Things on and beside each other."""
    wide, tall, made = dice.uniform(0.1, 0.5), dice.uniform(0.3, 2.0), []
    for n in range(int(dice.integers(1, 7))):
        half = dice.uniform(0.04, 0.4, 3)
        turn = about_y(dice.uniform(-1.6, 1.6)) @ about_x(dice.normal(0, 0.3)) @ about_z(dice.normal(0, 0.3))
        up = half[1] if n == 0 else dice.uniform(0.0, tall)
        centre = np.array([dice.uniform(-wide, wide), up, dice.uniform(-wide, wide)])
        made.append(Solid(centre, half, turn, bool(dice.random() < 0.4)))
    return made


def _pillar(dice: Dice) -> list[Solid]:
    """A pillar, a cupboard, a board, a door that stands open."""
    half = np.array([dice.uniform(0.06, 0.5), dice.uniform(0.4, 1.3), dice.uniform(0.01, 0.4)])
    return [Solid(np.array([0.0, half[1], 0.0]), half, np.eye(3), bool(dice.random() < 0.25))]


def _table(dice: Dice) -> list[Solid]:
    """A table, a stool or a chair, and something on it sometimes."""
    x, y, z = dice.uniform(0.18, 0.8), dice.uniform(0.3, 1.1), dice.uniform(0.18, 0.5)
    made = [_box((-x, y - 0.04, -z), (x, y, z))]
    for a, b in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        leg = np.array([a * (x - _LEG), 0.5 * y, b * (z - _LEG)])
        made.append(Solid(leg, np.array([_LEG, 0.5 * y, _LEG]), np.eye(3)))
    if dice.random() < 0.5:
        made.append(_box((-x, y, -z), (x, y + dice.uniform(0.2, 0.7), 0.04 - z)))
    if dice.random() < 0.5:
        half = dice.uniform(0.04, 0.25, 3)
        made.append(Solid(np.array([0.0, y + half[1], 0.0]), half, np.eye(3), bool(dice.random() < 0.5)))
    return made


def _rack(dice: Dice) -> list[Solid]:
    """A pole with arms, a lamp or a coat: a plant, a rack, a tripod."""
    tall = dice.uniform(0.8, 2.1)
    pole = dice.uniform(0.01, 0.05)
    made = [_box((-pole, 0.0, -pole), (pole, tall, pole))]
    for _ in range(int(dice.integers(0, 6))):
        turn = about_y(dice.uniform(-np.pi, np.pi)) @ about_z(dice.uniform(-1.2, 1.2))
        half = np.array([dice.uniform(0.1, 0.45), dice.uniform(0.01, 0.06), dice.uniform(0.01, 0.06)])
        made.append(Solid(np.array([0.0, dice.uniform(0.1, tall), 0.0]), half, turn))
    if dice.random() < 0.6:
        half = np.array([dice.uniform(0.1, 0.3), dice.uniform(0.08, 0.5), dice.uniform(0.08, 0.25)])
        made.append(Solid(np.array([0.0, tall - half[1], 0.0]), half, np.eye(3), True))
    return made


def piece_of_wall(shape: tuple[int, int], middle: Float, size: Float, dice: Dice) -> Bool:
    """(h, w) pixels of a random outline: what is left of a wall that is known here and there.

    Args:
        middle, size: (2,) pixels, row and column of its middle and about how large it is.
    """
    v, u = np.indices(shape)
    down, right = (v - middle[0]) / (0.5 * size[0] + 1.0), (u - middle[1]) / (0.5 * size[1] + 1.0)
    square = dice.random() < 0.4
    away = np.maximum(np.abs(down), np.abs(right)) if square else np.hypot(down, right)
    wander = ndimage.gaussian_filter(dice.normal(size=shape), dice.uniform(*_PATCHY))
    wander *= dice.uniform(0.1, 0.7) / (wander.std() + 1e-9)
    return np.asarray(away + wander < 1.0)
