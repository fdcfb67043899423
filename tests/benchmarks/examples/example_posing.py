"""Directions to an actor, as functions of the positions of control points.

    figure = Figure(names, rest, limbs)
    places = figure.posed(turn("right arm", 50, "up"), bend(8, "left"), squash(0.9))

A direction takes positions (P, 3), metres in the mesh's frame (+Y up, facing +Z, its left at +X), and returns
positions. Directions are applied in order: limbs first, then the trunk, which moves the limbs, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from enliven.arrays import Bool, Float
from enliven.rotation import from_rotation_vector, rotate

Side = Literal["up", "down", "left", "right", "front", "back", "out", "in"]
_SIDES = {
    "up": (0.0, 1.0, 0.0),
    "down": (0.0, -1.0, 0.0),
    "left": (1.0, 0.0, 0.0),
    "right": (-1.0, 0.0, 0.0),
    "front": (0.0, 0.0, 1.0),
    "back": (0.0, 0.0, -1.0),
}


@dataclass(frozen=True)
class Limb:
    """Control points that move together, from the trunk outwards, and their pivot.

    Attributes:
        points: names.
        pivot: a position (3,) at rest, metres, or the name of a control point, whose current position is
            used.
    """

    points: tuple[str, ...]
    pivot: tuple[float, float, float] | str


@dataclass(frozen=True, eq=False)
class Figure:
    """The actor.

    Attributes:
        names: (P,) of the control points.
        rest: (P, 3) metres.
        limbs: limbs by the names used in directions. A single control point may also be called by its own
            name.
        feet: names of the control points that stay where they are when the trunk moves.
        height: metres.
    """

    names: tuple[str, ...]
    rest: Float
    limbs: Mapping[str, Limb]
    feet: tuple[str, ...]
    height: float

    def posed(self, *directions: Direction) -> Float:
        """Returns (P, 3) metres: the rest positions after all directions were applied."""
        places = self.rest.copy()
        for direction in directions:
            places = direction(self, places)
        return places

    def rows(self, limb: str) -> list[int]:
        """Returns the control points of a limb, from the trunk outwards."""
        points = self.limbs[limb].points if limb in self.limbs else (limb,)
        return [self.names.index(point) for point in points]

    def pivot(self, limb: str, places: Float) -> Float:
        """Returns (3,) the pivot of a limb. For a single control point, it is a nearby point of the trunk."""
        if limb not in self.limbs:
            return self.rest[self.names.index(limb)] * [0.0, 1.0, 0.0]
        pivot = self.limbs[limb].pivot
        return places[self.names.index(pivot)] if isinstance(pivot, str) else np.array(pivot)

    def side(self, limb: str, side: Side) -> Float:
        """Returns (3,) a direction in the mesh's frame. "out" and "in" depend on the limb."""
        if side in ("out", "in"):
            left = self.rest[self.rows(limb)[-1], 0] >= 0.0
            side = "left" if left == (side == "out") else "right"
        return np.array(_SIDES[side])

    @property
    def stays(self) -> Bool:
        """Returns (P,) True for feet."""
        return np.array([name in self.feet for name in self.names])


Direction = Callable[[Figure, Float], Float]


def turn(limb: str, degrees: float, side: Side) -> Direction:
    """Rotates a limb rigidly about its pivot towards a side."""

    def follow(figure: Figure, places: Float) -> Float:
        rows, pivot = figure.rows(limb), figure.pivot(limb, places)
        return _turn_rows(places, rows, pivot, places[rows[-1]] - pivot, figure.side(limb, side), degrees)

    return follow


def curl(limb: str, degrees: float, side: Side) -> Direction:
    """Curls a limb towards a side: each of its points rotates about the point before, ``degrees`` in
    total."""

    def follow(figure: Figure, places: Float) -> Float:
        rows, pivot, to = figure.rows(limb), figure.pivot(limb, places), figure.side(limb, side)
        for k in range(len(rows)):
            about = pivot if k == 0 else places[rows[k - 1]]
            arm = places[rows[-1]] - about
            places = _turn_rows(places, rows[k:], about, arm, to, degrees / len(rows))
        return places

    return follow


def reach(limb: str, *, up: float = 0.0, front: float = 0.0, out: float = 0.0) -> Direction:
    """Moves the end of a limb by fractions of the height. Points nearer to the trunk move less."""

    def follow(figure: Figure, places: Float) -> Float:
        rows = figure.rows(limb)
        way = figure.height * (np.array([0.0, up, front]) + out * figure.side(limb, "out"))
        moved = places.copy()
        moved[rows] += np.linspace(0.0, 1.0, len(rows) + 1)[1:, None] * way
        return moved

    return follow


def put(
    limb: str, *, left: float | None = None, up: float | None = None, front: float | None = None
) -> Direction:
    """Moves the end of a limb to a position, in fractions of the height, and the limb with it.

    Positions are relative to the middle of the floor. Coordinates that are not given do not change.
    """

    def follow(figure: Figure, places: Float) -> Float:
        rows = figure.rows(limb)
        end = places[rows[-1]]
        goal = [
            now if wanted is None else wanted * figure.height
            for now, wanted in zip(end, (left, up, front), strict=True)
        ]
        moved = places.copy()
        moved[rows] += np.array(goal) - end
        return moved

    return follow


def lengthen(limb: str, factor: float) -> Direction:
    """Scales the length of a limb by ``factor``, from its pivot."""

    def follow(figure: Figure, places: Float) -> Float:
        rows, pivot = figure.rows(limb), figure.pivot(limb, places)
        moved = places.copy()
        moved[rows] = pivot + factor * (places[rows] - pivot)
        return moved

    return follow


def bend(degrees: float, side: Side) -> Direction:
    """Bends the trunk towards a side, increasingly with height. The feet stay."""

    def follow(figure: Figure, places: Float) -> Float:
        axis = np.cross(_SIDES["up"], figure.side(figure.names[0], side))
        angles = np.radians(degrees) * np.where(figure.stays, 0.0, figure.rest[:, 1] / figure.height)
        return np.asarray(rotate(from_rotation_vector(angles[:, None] * axis), places))

    return follow


def twist(degrees: float) -> Direction:
    """Rotates the trunk to its left about the vertical, increasingly with height. The feet stay."""

    def follow(figure: Figure, places: Float) -> Float:
        angles = np.radians(degrees) * np.where(figure.stays, 0.0, figure.rest[:, 1] / figure.height)
        return np.asarray(rotate(from_rotation_vector(angles[:, None] * np.array(_SIDES["up"])), places))

    return follow


def shift(*, up: float = 0.0, front: float = 0.0, left: float = 0.0) -> Direction:
    """Moves everything except the feet by fractions of the height. Crouching is up < 0."""

    def follow(figure: Figure, places: Float) -> Float:
        way = figure.height * np.array([left, up, front])
        return np.where(figure.stays[:, None], places, places + way)

    return follow


def squash(factor: float) -> Direction:
    """Scales the height by ``factor``, and the width so that the volume is kept. Above 1 it stretches."""

    def follow(figure: Figure, places: Float) -> Float:
        wider = 1.0 / np.sqrt(factor)
        return np.where(figure.stays[:, None], places, places * [wider, factor, wider])

    return follow


def _turn_rows(places: Float, rows: list[int], about: Float, arm: Float, to: Float, degrees: float) -> Float:
    """Returns the rows rotated about a point, so that the direction ``arm`` turns towards ``to``."""
    axis = np.cross(arm, to)
    length = np.linalg.norm(axis)
    moved = places.copy()
    if length > 1e-6 * np.linalg.norm(arm):
        turning = from_rotation_vector(np.radians(degrees) * axis / length)
        moved[rows] = about + rotate(turning, places[rows] - about)
    return moved
