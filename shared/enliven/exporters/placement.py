"""Options that every format can share: scale, vertical axis, motion in place, and the unit of length."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.exporters.performance import Performance
from enliven.rotation import conjugate, from_matrix, multiply

PLACEMENTS = ("scale", "up", "in_place")
"""The names of the options of :class:`ExportPlacement`."""
_UP_TURNS = {"y": np.eye(3), "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])}
"""Rotations from enliven's axes, +Y up, to those of a file, by its vertical axis. +X stays."""
_UNITS_PER_METRE = {"m": 1.0, "cm": 100.0}
"""Units of a file per metre."""
_MAX_SCALE = 1e6
"""Maximum scale and its reciprocal. Beyond it, float32 loses the motion."""


def units_per_metre(unit: str = "m") -> float:
    """Returns the number of units per metre.

    Raises:
        InputError: for an unknown unit.
    """
    if unit not in _UNITS_PER_METRE:
        raise InputError(
            f"the unit {unit!r} does not exist", where="--unit", mend=f"Known: {', '.join(_UNITS_PER_METRE)}."
        )
    return _UNITS_PER_METRE[unit]


@dataclass(frozen=True)
class ExportPlacement:
    """The size, the axes and the root motion of exported characters.

    Attributes:
        scale: factor of all lengths.
        up: the vertical axis of the file: "y", or "z", which turns +Y to +Z and +Z to -Y.
        in_place: True to remove the horizontal motion of the root. It stays where the first frame has it.

    Raises:
        InputError: if a value is invalid.
    """

    scale: float = 1.0
    up: str = "y"
    in_place: bool = False

    def __post_init__(self) -> None:
        if not (math.isfinite(self.scale) and 1.0 / _MAX_SCALE <= self.scale <= _MAX_SCALE):
            mend = f"Give a number from {1.0 / _MAX_SCALE:g} to {_MAX_SCALE:g}."
            raise InputError(f"{self.scale:g} is not a scale", where="--scale", mend=mend)
        if self.up not in _UP_TURNS:
            mend = f"Known: {', '.join(_UP_TURNS)}."
            raise InputError(f"the axis {self.up!r} cannot be vertical", where="--up", mend=mend)

    def applied_to(self, performance: Performance) -> Performance:
        """Returns a placed performance."""
        if self.in_place:
            performance = _without_travel(performance)
        return performance if self.scale == 1.0 and self.up == "y" else self._mapped(performance)

    def _mapped(self, performance: Performance) -> Performance:
        """Returns a performance with scaled lengths and rotated axes, at rest and in motion."""
        turn, scale = _UP_TURNS[self.up], self.scale

        def points(values: Float) -> Float:
            return np.asarray(values @ (scale * turn.T))

        mapped = replace(
            performance,
            pivots=points(performance.pivots),
            linear=turn @ performance.linear @ turn.T,
            positions=points(performance.positions),
            keys=performance.keys * scale,
            # The curves are in the file's axes. If these are rotated, only the sampled frames remain valid.
            cubic=tuple(
                curve
                if curve.turns
                else replace(curve, values=curve.values * scale, slopes=curve.slopes * scale)
                for curve in performance.cubic
            )
            if self.up == "y"
            else (),
        )
        if performance.mesh is not None:
            mapped = replace(
                mapped, mesh=replace(performance.mesh, vertices=points(performance.mesh.vertices))
            )
        if performance.skeleton is not None:
            skeleton = replace(performance.skeleton, positions=points(performance.skeleton.positions))
            mapped = replace(mapped, skeleton=skeleton)
        if performance.joints is not None:
            mapped = replace(mapped, joints=points(performance.joints))
        if performance.axes is not None:
            mapped = replace(mapped, axes=turn @ performance.axes @ turn.T)
        if performance.turns is not None and performance.places is not None:
            around = from_matrix(turn)
            turns = multiply(multiply(around, performance.turns), conjugate(around))
            mapped = replace(mapped, turns=turns, places=points(performance.places))
        if performance.morphs is not None:
            morphs = replace(
                performance.morphs,
                targets=points(performance.morphs.targets),
                normals=performance.morphs.normals @ turn.T,
            )
            mapped = replace(mapped, morphs=morphs)
        if performance.solved is not None:
            solved = performance.solved
            mapped = replace(mapped, solved=lambda: (points(frame) for frame in solved()))
        return mapped


def _without_travel(performance: Performance) -> Performance:
    """Returns a performance without the horizontal motion of its root.

    The root is that of the skeleton, or the frame of the whole surface, or else the mean of all transforms.
    """
    if performance.skeleton is None and performance.places is not None:
        return replace(performance, places=performance.places - _travel(performance.places))
    rooted = performance.skeleton is not None
    travel = _travel(performance.positions[:, 0] if rooted else performance.positions.mean(1))
    joints = performance.joints
    return replace(
        performance,
        positions=performance.positions - travel[:, None],
        joints=None if joints is None else joints - travel[:, None],
        cubic=tuple(curve for curve in performance.cubic if curve.turns),
    )


def _travel(places: Float) -> Float:
    """Returns (T, 3) metres, the horizontal motion since the first frame."""
    return np.asarray((places - places[0]) * [1.0, 0.0, 1.0])
