"""Options that every format can support: scale, vertical axis, motion in place, and the unit of length."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.exporters.option_table import IN_PLACE, MAX_SCALE, SCALE, UP
from enliven.exporters.performance import Performance
from enliven.rotation import conjugate, from_matrix, multiply

PLACEMENTS = (SCALE.name, UP.name, IN_PLACE.name)
"""The names of the options of :class:`ExportPlacement`."""
_UP_TURNS = {"y": np.eye(3), "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])}
"""Rotations from enliven's axes (+Y up) to those of a file, by the file's vertical axis. +X does not
change."""
_UNITS_PER_METRE = {"m": 1.0, "cm": 100.0}
"""Number of file units per metre."""


def units_per_metre(unit: str = "m") -> float:
    """Returns the number of units per metre.

    Raises:
        InputError: for an unknown unit.
    """
    if unit not in _UNITS_PER_METRE:
        raise InputError(
            f"the unit {unit!r} is unknown",
            where="--unit",
            remedy=f"Known units: {', '.join(_UNITS_PER_METRE)}.",
        )
    return _UNITS_PER_METRE[unit]


@dataclass(frozen=True)
class ExportPlacement:
    """The size, the axes and the root motion of exported characters.

    Attributes:
        scale: factor of all lengths.
        up: the vertical axis of the file: "y", or "z", which rotates +Y to +Z and +Z to -Y.
        in_place: True to remove the horizontal motion of the root. The root stays at its position in the
            first frame.

    Raises:
        InputError: if a value is invalid.
    """

    scale: float = SCALE.default
    up: str = UP.default
    in_place: bool = IN_PLACE.default

    def __post_init__(self) -> None:
        if not (math.isfinite(self.scale) and 1.0 / MAX_SCALE <= self.scale <= MAX_SCALE):
            remedy = f"Choose a number from {1.0 / MAX_SCALE:g} to {MAX_SCALE:g}."
            raise InputError(f"the scale {self.scale:g} is not allowed", where="--scale", remedy=remedy)
        if self.up not in _UP_TURNS:
            remedy = f"Known vertical axes: {', '.join(_UP_TURNS)}."
            raise InputError(f"the axis {self.up!r} cannot be vertical", where="--up", remedy=remedy)

    def apply_to(self, performance: Performance) -> Performance:
        """Returns a performance with the scale, axes and root motion of this placement."""
        if self.in_place:
            performance = _remove_travel(performance)
        return (
            performance if self.scale == 1.0 and self.up == "y" else self._convert_units_and_axes(performance)
        )

    def _convert_units_and_axes(self, performance: Performance) -> Performance:
        """Returns a performance with scaled lengths and rotated axes, at rest and in motion."""
        rotation, scale = _UP_TURNS[self.up], self.scale

        def points(values: Float) -> Float:
            return np.asarray(values @ (scale * rotation.T))

        placed = replace(
            performance,
            pivots=points(performance.pivots),
            linear=rotation @ performance.linear @ rotation.T,
            positions=points(performance.positions),
            keys=performance.keys * scale,
            # The curves are in the file's axes. If the placement rotates them, only the sampled frames remain
            # valid.
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
            placed = replace(
                placed, mesh=replace(performance.mesh, vertices=points(performance.mesh.vertices))
            )
        if performance.skeleton is not None:
            skeleton = replace(performance.skeleton, positions=points(performance.skeleton.positions))
            placed = replace(placed, skeleton=skeleton)
        if performance.joints is not None:
            placed = replace(placed, joints=points(performance.joints))
        if performance.axes is not None:
            placed = replace(placed, axes=rotation @ performance.axes @ rotation.T)
        if performance.turns is not None and performance.places is not None:
            around = from_matrix(rotation)
            rotations = multiply(multiply(around, performance.turns), conjugate(around))
            placed = replace(placed, turns=rotations, places=points(performance.places))
        if performance.morphs is not None:
            morphs = replace(
                performance.morphs,
                targets=points(performance.morphs.targets),
                normals=performance.morphs.normals @ rotation.T,
            )
            placed = replace(placed, morphs=morphs)
        if performance.solved is not None:
            solved_frames = performance.solved
            placed = replace(placed, solved=lambda: (points(frame) for frame in solved_frames()))
        return placed


def _remove_travel(performance: Performance) -> Performance:
    """Returns a performance without the horizontal motion of its root.

    The root is the skeleton's root, or the frame of the whole surface, or else the mean of all transforms.
    """
    if performance.skeleton is None and performance.places is not None:
        return replace(performance, places=performance.places - _horizontal_motion(performance.places))
    rooted = performance.skeleton is not None
    travel = _horizontal_motion(performance.positions[:, 0] if rooted else performance.positions.mean(1))
    joints = performance.joints
    return replace(
        performance,
        positions=performance.positions - travel[:, None],
        joints=None if joints is None else joints - travel[:, None],
        cubic=tuple(curve for curve in performance.cubic if curve.turns),
    )


def _horizontal_motion(places: Float) -> Float:
    """Returns the horizontal motion (T, 3) in metres since the first frame."""
    return np.asarray((places - places[0]) * [1.0, 0.0, 1.0])
