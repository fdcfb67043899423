"""Finds the cubic keys of an imported file for export. They can be kept if a shape plays only a clip of that
file."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, CubicKeys, Layer, Project, RiggedCharacter, Skeleton
from enliven.exporters.performance import Performance
from enliven.rotation import IDENTITY, conjugate, from_matrix, multiply

_MAX_CURVE_DEVIATION = 1e-2
"""Maximum deviation of a curve from the sampled motion, in radians or as a fraction of the skeleton's length.

Interpolation between frames at 120 Hz has errors of this size during fast rotations. A larger deviation means
that the bone also has other motion.
"""
_MAX_POSED_CHANGE = 1e-9
"""Maximum change of a quaternion entry, or of the root in metres, that counts as rounding. A larger change is
an edit of an artist.
"""


_MAX_RIGID_STRETCH = 1e-6
"""Maximum stretch of a bone that counts as rigid. It allows for rounding errors in long chains."""


def find_file_keys(
    project: Project, shape: RiggedCharacter, performance: Performance, start: float
) -> tuple[CubicKeys, ...]:
    """Returns the cubic keys that move a shape, with times in seconds of its performance.

    All bones must play one clip with cubic keys, once, forwards and at one speed, and nothing else may move
    them. The result is empty for layered, blended, looped, smoothed or edited motion, which is sampled
    instead.

    Args:
        project: contains the shape.
        shape: the animated shape (a rigged model).
        performance: its sampled motion.
        start: time in the project at which the performance begins, in seconds.
    """
    clip, layer = _find_only_clip(project, shape)
    skeleton = performance.skeleton
    if clip is None or layer is None or skeleton is None or not _is_rigid(performance.linear):
        return ()
    (segment,) = layer.lane(clip.duration)
    speed = layer.speed * segment.speed
    begin_s = layer.offset + segment.begin / layer.speed - start
    first = segment.first + max(0.0, -begin_s) * speed
    last = segment.first + (min(float(performance.times[-1]) - begin_s, segment.last / speed)) * speed
    last = min(last, segment.last, clip.duration)
    curves = list[CubicKeys]()
    for curve in clip.cubic:
        curves.append(curve.cut(first, last).retime(speed, begin_s - segment.first / speed))
    return tuple(
        curve
        for curve in curves
        if not _is_posed(curve, shape) and _matches_motion(curve, skeleton, performance)
    )


def _is_rigid(linear: Float) -> bool:
    """Returns True if none of the linear maps (T, N, 3, 3) stretches or mirrors its bone."""
    gram = np.einsum("tnba,tnbc->tnac", linear, linear)
    return bool(np.abs(gram - np.eye(3)).max() <= _MAX_RIGID_STRETCH and (np.linalg.det(linear) > 0).all())


def _find_only_clip(project: Project, shape: RiggedCharacter) -> tuple[Clip | None, Layer | None]:
    """Returns the clip that all bones of a shape play in the same way, and one of its layers, or (None, None)
    if they do not share a clip.
    """
    if not shape.layers or shape.root_layers or shape.pins:
        return None, None
    layer = shape.layers[0]
    clip = project.takes.get(layer.take)
    is_same_clip = all(
        _playing_fields(other_layer) == _playing_fields(layer) and (other_layer.basis == IDENTITY).all()
        for other_layer in shape.layers
    )
    is_plain = not (
        layer.loop or layer.muted or layer.mirrored or layer.smooth or layer.weights or layer.speeds
    )
    is_plain = is_plain and layer.hold and layer.weight == 1.0 and layer.mode == "turns" and layer.speed > 0.0
    if not (is_same_clip and is_plain and isinstance(clip, Clip) and clip.cubic):
        return None, None
    lane = layer.lane(clip.duration)
    return (clip, layer) if len(lane) == 1 and lane[0].speed > 0.0 else (None, None)


def _playing_fields(layer: Layer) -> tuple[object, ...]:
    """Returns the fields of a layer that define its timing and its effect."""
    time_fields = (
        layer.take,
        layer.offset,
        layer.speed,
        layer.loop,
        layer.segments,
        layer.hold,
        layer.smooth,
    )
    blend_fields = (
        layer.weight,
        layer.muted,
        layer.mirrored,
        layer.mode,
        layer.weights,
        layer.speeds,
        layer.stretch,
    )
    return time_fields + blend_fields


def _is_posed(keys: CubicKeys, shape: RiggedCharacter) -> bool:
    """Returns True if an artist has edited the bone of a curve, or has moved the root."""
    offset = np.abs(shape.modeling[keys.bone]) - IDENTITY if keys.turns else shape.place
    return bool(np.abs(offset).max() > _MAX_POSED_CHANGE)


def _matches_motion(keys: CubicKeys, skeleton: Skeleton, performance: Performance) -> bool:
    """Returns True if a curve agrees with the sampled motion at all times."""
    sampled_values = keys.evaluate(performance.times)
    if not keys.turns:
        root_error = np.abs(sampled_values - performance.positions[:, 0]).max()
        return bool(root_error <= _MAX_CURVE_DEVIATION * max(float(skeleton.lengths.sum()), 1e-9))
    rotations = _bone_rotations(performance, keys.bone)
    if keys.bone:
        rotations = multiply(
            conjugate(_bone_rotations(performance, int(skeleton.parents[keys.bone]))), rotations
        )
    return bool(
        2.0 * np.arccos(np.clip(np.abs((sampled_values * rotations).sum(1)), 0.0, 1.0)).max()
        <= _MAX_CURVE_DEVIATION
    )


def _bone_rotations(performance: Performance, bone: int) -> Float:
    return from_matrix(performance.linear[:, bone])
