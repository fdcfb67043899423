"""Root layers: the rotation and displacement of a whole character in the world, on top of its other
layers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Clip, Project, RigBase, RootLayer
from enliven.errors import InputError
from enliven.modeling.rigged.axes import Axes
from enliven.rotation import (
    IDENTITY,
    conjugate,
    from_rotation_vector,
    multiply,
    normalized,
    rotate,
    slerp,
    to_rotation_vector,
)

_MIN_LAYER_WEIGHT = 1e-3
"""Minimum weight of a layer that can be posed by hand. With less weight, keys would need values a thousand
times larger."""


class RigidMotion(NamedTuple):
    """A rigid motion x -> turn x + move at one or several times: rotation (..., 4) and displacement (..., 3)
    in metres."""

    turn: Float
    move: Float

    def __call__(self, points: AnyArray) -> Float:
        """Transforms points (..., N, 3) in metres. The leading axes are those of the motion: one set of N
        points for each time."""
        points = np.asarray(points, np.float64)
        return rotate(self.turn[..., None, :], points) + self.move[..., None, :]

    def after(self, first: RigidMotion) -> RigidMotion:
        """Returns the composition of two motions: first ``first``, then this motion."""
        return RigidMotion(
            normalized(multiply(self.turn, first.turn)), rotate(self.turn, first.move) + self.move
        )

    @property
    def inverse(self) -> RigidMotion:
        """The inverse motion."""
        back = conjugate(self.turn)
        return RigidMotion(back, -rotate(back, self.move))


IDENTITY_MOTION = RigidMotion(IDENTITY, np.zeros(3))
"""The identity: a rigid motion that changes nothing."""


def about(turn: Float, offset: Float, centre: Float) -> RigidMotion:
    """Returns the motion x -> turn (x - centre) + centre + offset, with ``turn`` (4,) and the others (3,)
    metres."""
    return RigidMotion(turn, centre + offset - rotate(turn, centre))


def root_motion(project: Project, character: RigBase, time: float) -> RigidMotion:
    """Returns the combined motion of all root layers of a character at a time of the project.

    Raises:
        InputError: if the time is not finite.
    """
    if not np.isfinite(time):
        raise InputError(
            f"the time {time} is not a finite number",
            where=character.where,
            remedy="Pass a finite number of seconds.",
        )
    motion = IDENTITY_MOTION
    for layer in character.root_layers:
        motion = _layer_motion(project, layer, time)[0].after(motion)
    return motion


def root_motions(project: Project, character: RigBase, times: AnyArray | Sequence[float]) -> RigidMotion:
    """Returns the combined motion of the root layers at times (T,): rotations (T, 4) and moves (T, 3)."""
    seconds = [root_motion(project, character, float(time)) for time in times]
    return RigidMotion(
        np.array([motion.turn for motion in seconds]), np.array([motion.move for motion in seconds])
    )


def root_values(
    project: Project, character: RigBase, number: int, motion: RigidMotion, time: float
) -> tuple[Float, Float]:
    """Computes the values that the clip of one root layer needs at a time, so that all root layers together
    result in ``motion``.

    Args:
        number: index of the layer among the root layers.

    Returns:
        (3,) radians and (3,) metres.

    Raises:
        InputError: if the layer does not play at that time.
    """
    outer, inner = IDENTITY_MOTION, IDENTITY_MOTION
    for k, other in enumerate(character.root_layers):
        if k != number:
            other_motion = _layer_motion(project, other, time)[0]
            outer, inner = (
                (other_motion.after(outer), inner) if k > number else (outer, other_motion.after(inner))
            )
    layer = character.root_layers[number]
    weight = _layer_motion(project, layer, time)[1]
    if weight < _MIN_LAYER_WEIGHT:
        remedy = (
            "Unmute the layer, raise its weight, or move the playhead to a time at which the layer plays."
        )
        raise InputError(
            "the keys of this layer have no effect at the current time",
            where=f"layer {layer.id!r}",
            remedy=remedy,
        )
    layer_motion = outer.inverse.after(motion).after(inner.inverse)
    moved = layer_motion.move - layer.about + rotate(layer_motion.turn, layer.about)
    back, flip = Axes(conjugate(layer.basis), False), Axes(IDENTITY, layer.mirrored)
    turned = to_rotation_vector(flip.rotations(back.rotations(layer_motion.turn)))
    return turned / weight, flip.vectors(back.vectors(moved)) / (weight * layer.size)


def _layer_motion(project: Project, layer: RootLayer, time: float) -> tuple[RigidMotion, float]:
    """Returns the motion of one layer at a time in seconds of the project, and the layer's weight."""
    clip = project.take_of(layer)
    assert isinstance(clip, Clip)
    second = layer.moment(time, clip.duration)
    weight = 0.0 if layer.muted else layer.weight * second.weight
    if weight == 0.0:
        return IDENTITY_MOTION, 0.0
    turn, place = _find_recorded_root(clip, second.second)
    if second.share > 0.0:
        turn, place = _interpolate_root((turn, place), _find_recorded_root(clip, second.other), second.share)
    axes = Axes(layer.basis, layer.mirrored)
    turn = axes.rotations(from_rotation_vector(weight * to_rotation_vector(turn)))
    return about(turn, weight * layer.size * axes.vectors(place), layer.about), weight


def _find_recorded_root(clip: Clip, second: float) -> tuple[Float, Float]:
    """Returns the rotation (4,) and position (3,) in metres of a clip's root at a time of the clip in
    seconds."""
    last = len(clip.turns) - 1
    frame = min(second / clip.step, float(last))
    previous = min(int(frame), max(last - 1, 0))
    rows = [(clip.turns[k, 0], clip.root[k]) for k in (previous, min(previous + 1, last))]
    return _interpolate_root(rows[0], rows[1], frame - previous)


def _interpolate_root(
    start: tuple[Float, Float], end: tuple[Float, Float], fraction: float
) -> tuple[Float, Float]:
    turn = slerp(start[0], end[0], np.asarray(fraction))
    return turn, start[1] + fraction * (end[1] - start[1])
