"""World transforms of the nodes of a glTF file: at rest, and over time in one of its animations."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from enliven import rotation
from enliven.arrays import Float
from enliven.meshes.gltf.file import GltfFile, compose_matrices
from enliven.rotation import unit

_MAX_STEP_S = 1 / 24
"""Maximum seconds between samples. With a longer step, interpolation between samples would deviate from the
file's motion."""
_MIN_STEP_S = 1 / 120
"""Minimum seconds between samples. Denser keys have no visible effect and need more memory."""
_ZERO_SCALE_FRACTION = 1e-5
"""Fraction of a node's largest scale that replaces a scale of 0. The result is invertible, but too small to
be visible."""
_CURVED_STEP_S = 1 / 120
"""Maximum seconds between samples of cubic channels. Between samples, the curve is replaced by a straight
line."""
_MIN_LOG_SCALE_CHANGE = 0.3
"""If the logarithm of a scale changes by more than this between two keys (a factor of 1.35), frames are
inserted."""
_GROWTH_STEP_S = 1 / 240
"""Minimum seconds between the frames that are inserted where the scale changes quickly."""
_MAX_INSERTED_FRAMES = 64
"""Maximum number of frames inserted between two keys. In a long interval, the scale changes slowly."""
JUMP_DURATION_S = 2.5e-4
"""Duration of a jump of a STEP channel, seconds. The previous value stays constant until this time before the
key. No display shows the transition, and float32 times can represent it for up to an hour."""
_SAME_TIME_S = 1e-4
"""Maximum difference, in seconds, between two times that count as equal. It allows for rounding errors of
float32."""
MAX_NODE_SAMPLES = 1 << 23
"""Maximum product of frames and nodes, summed over all animations of a file. It corresponds to 2 GB of
matrices, or 46 min of 100 nodes at 30 fps."""


@dataclass
class Locals:
    """The local transform of each node: translation (F, n, 3), rotation (F, n, 4) as (x, y, z, w) and scale
    (F, n, 3).

    If a node has a matrix instead, ``fixed`` contains it. In glTF, such a node is never animated.
    """

    translation: Float
    rotation: Float
    scale: Float
    fixed: dict[int, Float]


def rest_locals(file: GltfFile) -> Locals:
    """Returns the nodes' rest transforms in the file (one frame, F = 1). Scales of 0 are replaced by a tiny
    scale.
    """
    transforms = _collect_rest_transforms(file)
    _replace_zero_scales(transforms, file.scale_keys)
    return transforms


def bind_locals(file: GltfFile, still: bool = False) -> Locals:
    """Returns the nodes' rest transforms for the bind pose (one frame, F = 1).

    A node with scale 0 in the file gets the scale of its animations, so that objects that appear during an
    animation have a shape. A node that is mirrored in all animations, but not in the file's rest pose, is
    mirrored, unless ``still`` is set.
    """
    transforms, sizes = _collect_rest_transforms(file), file.scale_keys
    for node, clips in sizes.items():
        rest = transforms.scale[0, node]
        keys = np.concatenate(list(clips.values()))
        largest = keys[np.abs(keys).argmax(0), np.arange(3)]
        rest[:] = np.where(np.abs(rest) < _ZERO_SCALE_FRACTION * np.abs(largest), largest, rest)
        signs = [np.sign(scales).prod(1) for scales in clips.values()]
        if (
            not still
            and len(clips) == len(file.document.animations)
            and all((s == -np.sign(rest.prod())).all() for s in signs)
        ):
            rest[:] = keys[0]
    _replace_zero_scales(transforms, sizes)
    return transforms


def _replace_zero_scales(made: Locals, sizes: dict[int, dict[int, Float]]) -> None:
    """Replaces scales of 0 by a tiny fraction of the node's largest scale, so that every transform is
    invertible."""
    largest = np.abs(made.scale).max((0, 2))
    for node, clips in sizes.items():
        largest[node] = max(largest[node], *(np.abs(keys).max(initial=0.0) for keys in clips.values()))
    tiny_scale = np.where(largest > 0.0, largest, 1.0)[:, None] * _ZERO_SCALE_FRACTION
    made.scale = np.where(
        np.abs(made.scale) < tiny_scale, np.where(made.scale < 0.0, -tiny_scale, tiny_scale), made.scale
    )
    for node, matrix in made.fixed.items():
        left, stretch, right = np.linalg.svd(matrix[:3, :3])
        floor = _ZERO_SCALE_FRACTION * (stretch[0] if stretch[0] > 0.0 else 1.0)
        if stretch[2] < floor:
            matrix[:3, :3] = left * np.maximum(stretch, floor) @ right
            made.fixed[node] = matrix


def zero_scale_nodes(file: GltfFile) -> set[int]:
    """Returns the nodes with scale 0 at rest and in all animations, with their whole subtrees."""
    stated, zero_nodes = _collect_rest_transforms(file), set[int]()
    for node in range(len(file.parents)):
        fixed = stated.fixed.get(node)
        size = stated.scale[0, node] if fixed is None else fixed[:3, :3]
        clips = file.scale_keys.get(node, {})
        if not size.any() and not any(keys.any() for keys in clips.values()):
            zero_nodes.add(node)
    for node in range(len(file.parents)) if zero_nodes else ():
        ancestor = node
        while ancestor >= 0 and ancestor not in zero_nodes:
            ancestor = file.parents[ancestor]
        if ancestor >= 0:
            zero_nodes.add(node)
    return zero_nodes


def _collect_rest_transforms(file: GltfFile) -> Locals:
    """Returns the nodes' rest transforms in the file (one frame, F = 1)."""
    nodes = file.document.nodes
    count = len(nodes)
    transforms = Locals(np.zeros((1, count, 3)), np.zeros((1, count, 4)), np.ones((1, count, 3)), {})
    transforms.rotation[..., 3] = 1.0
    for number, node in enumerate(nodes):
        if node.matrix is not None:
            transforms.fixed[number] = np.array(node.matrix, np.float64).reshape(4, 4).T
        if node.translation is not None:
            transforms.translation[0, number] = node.translation
        if node.rotation is not None:
            transforms.rotation[0, number] = node.rotation
        if node.scale is not None:
            transforms.scale[0, number] = node.scale
    if not all(
        np.isfinite(values).all()
        for values in (transforms.translation, transforms.rotation, transforms.scale)
    ):
        raise file.create_error("the position, rotation or scale of a node is not a finite number")
    return transforms


def world_matrices(file: GltfFile, locals_: Locals) -> Float:
    """Returns the (F, n, 4, 4) world transforms world_from_node of all nodes."""
    local = compose_matrices(locals_.translation, locals_.rotation, locals_.scale)
    for number, matrix in locals_.fixed.items():
        local[:, number] = matrix
    world, finished_nodes = local.copy(), set[int]()
    for node in range(len(file.parents)):
        _compute_world(file.parents, world, local, finished_nodes, node)
    return world


def _compute_world(parents: list[int], world: Float, local: Float, done: set[int], node: int) -> None:
    """Computes the world matrices of a node, after those of its ancestors (a file may list nodes in any
    order).
    """
    waiting = [node]
    while waiting:
        current = waiting[-1]
        if current in done:
            waiting.pop()
        elif parents[current] < 0 or parents[current] in done:
            if parents[current] >= 0:
                world[:, current] = world[:, parents[current]] @ local[:, current]
            done.add(current)
            waiting.pop()
        else:
            waiting.append(parents[current])


def frame_times(file: GltfFile, animation: int) -> Float:
    """Returns (F,) evenly spaced sample times of an animation, in seconds.

    If the keys are evenly spaced, their times are among the sample times.
    """
    samplers = _find_used_samplers(file, animation)
    keys = [_key_times(file, sampler.input) for sampler in samplers]
    keys = [k for k in keys if len(k)]
    if not keys:
        return np.zeros(1)
    start, end = min(k[0] for k in keys), max(k[-1] for k in keys)
    gaps = [float(np.median(np.diff(k))) for k in keys if len(k) > 1]
    gap = max(min(gaps, default=_MAX_STEP_S), _MIN_STEP_S)
    longest = _CURVED_STEP_S if any(s.interpolation == "CUBICSPLINE" for s in samplers) else _MAX_STEP_S
    # Divide the interval between two keys into a whole number of frames, so that each key lies on a frame.
    gap /= max(math.ceil(gap / longest - 1e-3), 1)
    steps = max(round(float(end - start) / gap), 1)
    if (steps + 1) * len(file.parents) > MAX_NODE_SAMPLES:
        raise file.create_error(f"an animation of {end - start:.3g} s has too many frames: {steps + 1}")
    return np.asarray(np.linspace(start, end, steps + 1) if end > start else np.array([start]))


def key_times(file: GltfFile, animation: int, even: Float) -> Float:
    """Returns the times (K,), in seconds, of the keys that are not at one of the evenly spaced times ``even``
    (F,).

    Each jump of a STEP channel adds two times: just before its key, and at the key.
    """
    candidates, step = list[Float](), float(even[1] - even[0]) if len(even) > 1 else 1.0
    for sampler in _find_used_samplers(file, animation):
        keys = _key_times(file, sampler.input)
        if sampler.interpolation == "STEP" and len(keys) > 1:
            values = np.asarray(file.accessor(sampler.output), np.float64)
            jumps = keys[1:][np.abs(np.diff(values[: len(keys)], axis=0)).max(1) > 0.0]
            candidates += [jumps, jumps - JUMP_DURATION_S]
        else:
            candidates.append(keys)
    candidates += _scale_change_times(file, animation)
    seconds = np.unique(np.concatenate([np.zeros(0), *candidates]))
    seconds = seconds[(seconds > even[0]) & (seconds < even[-1])]
    nearest = even[0] + np.round((seconds - even[0]) / step) * step
    seconds = seconds[np.abs(seconds - nearest) > _SAME_TIME_S]
    # Drop a key that follows another key too closely, because their times would be equal in float32.
    return np.asarray(seconds[np.diff(seconds, prepend=-np.inf) > _SAME_TIME_S])


def _scale_change_times(file: GltfFile, animation: int) -> list[Float]:
    """Returns additional sample times (K,), in seconds, between keys with strongly different scales of a
    node.

    They are needed because a clip interpolates the logarithm of a scale between frames, but the file
    interpolates the scale itself.
    """
    animation_entry = file.document.animations[animation]
    times = list[Float]()
    for channel in animation_entry.channels or []:
        sampler = animation_entry.samplers[channel.sampler]
        if channel.target.path != "scale" or channel.target.node is None or sampler.interpolation == "STEP":
            continue
        keys, sizes = _key_times(file, sampler.input), file.scale_keys[channel.target.node][animation]
        logs = np.log(np.maximum(np.abs(sizes), _ZERO_SCALE_FRACTION))
        for k in np.flatnonzero(np.abs(np.diff(logs, axis=0)).max(1, initial=0.0) > _MIN_LOG_SCALE_CHANGE):
            count = min(int((keys[k + 1] - keys[k]) / _GROWTH_STEP_S) + 1, _MAX_INSERTED_FRAMES)
            times.append(np.linspace(keys[k], keys[k + 1], count + 1))
    return times


def _find_used_samplers(file: GltfFile, animation: int) -> list[Any]:
    """Returns the samplers of the channels that move nodes."""
    animation_entry = file.document.animations[animation]
    used = {
        channel.sampler
        for channel in animation_entry.channels or []
        if channel.target.node is not None and channel.target.path in ("translation", "rotation", "scale")
    }
    return [animation_entry.samplers[number] for number in sorted(used)]


def sample_animated_locals(file: GltfFile, animation: int, times: Float) -> Locals:
    """Samples every channel of an animation at ``times`` (F,) seconds."""
    rest = _collect_rest_transforms(file)
    count = len(times)
    transforms = Locals(
        np.repeat(rest.translation, count, 0),
        np.repeat(rest.rotation, count, 0),
        np.repeat(rest.scale, count, 0),
        dict(rest.fixed),
    )
    animation_entry = file.document.animations[animation]
    for channel in animation_entry.channels:
        node, path = channel.target.node, channel.target.path
        if node is None or path not in ("translation", "rotation", "scale"):
            continue
        sampler = animation_entry.samplers[channel.sampler]
        values = file.keys(sampler, path)
        samples = sample_channel(
            _key_times(file, sampler.input), values, sampler.interpolation or "LINEAR", path, times
        )
        getattr(transforms, path)[:, node] = samples
        transforms.fixed.pop(node, None)
    _replace_zero_scales(transforms, file.scale_keys)
    return transforms


def _key_times(file: GltfFile, accessor: int) -> Float:
    keys = np.asarray(file.accessor(accessor)[:, 0], np.float64)
    if not np.isfinite(keys).all() or (np.diff(keys) < 0).any():
        raise file.create_error("the key times of an animation are not in ascending order")
    return keys


def sample_channel(keys: Float, values: Float, interpolation: str, path: str, times: Float) -> Float:
    """Returns the values (F, C) of a channel at ``times`` (F,), as glTF 2.0 appendix C defines them.

    Before the first and after the last key, the value stays constant.

    Args:
        keys: (K,) times of the keys in seconds.
        values: (K, C) values at the keys. For CUBICSPLINE (3K, C): in-tangent, value and out-tangent of each
            key.
    """
    cubic = interpolation == "CUBICSPLINE"
    points = values[1::3] if cubic else values
    if len(keys) == 1:
        return np.repeat(points[:1], len(times), 0)
    times = np.clip(times, keys[0], keys[-1])
    previous = np.clip(np.searchsorted(keys, times, "right") - 1, 0, len(keys) - 2)
    span = np.maximum(keys[previous + 1] - keys[previous], 1e-12)
    fraction = np.clip((times - keys[previous]) / span, 0.0, 1.0)
    if interpolation == "STEP":
        return np.asarray(points[np.where(fraction >= 1.0, previous + 1, previous)])
    if cubic:
        curve = _hermite_spline(values, previous, span[:, None], fraction[:, None])
        return unit(curve) if path == "rotation" else curve
    if path == "rotation":
        # slerp works with any order of the quaternion components, because both quaternions use the same
        # order.
        a, b = unit(points[previous]), unit(points[previous + 1])
        return np.roll(rotation.slerp(np.roll(a, 1, -1), np.roll(b, 1, -1), fraction), -1, -1)
    return np.asarray(points[previous] + fraction[:, None] * (points[previous + 1] - points[previous]))


def _hermite_spline(values: Float, previous_keys: np.ndarray, span: Float, s: Float) -> Float:  # type: ignore[type-arg]
    """Returns the values (F, C) of the cubic Hermite spline between two keys, given their values and
    tangents."""
    p0, out_tangent = values[3 * previous_keys + 1], span * values[3 * previous_keys + 2]
    p1, in_tangent = values[3 * previous_keys + 4], span * values[3 * previous_keys + 3]
    return np.asarray(
        (2 * s**3 - 3 * s**2 + 1) * p0
        + (s**3 - 2 * s**2 + s) * out_tangent
        + (3 * s**2 - 2 * s**3) * p1
        + (s**3 - s**2) * in_tangent
    )
