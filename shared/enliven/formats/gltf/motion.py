"""World transforms of the nodes of a glTF file: at rest, and over time in one of its animations."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven import rotation
from enliven.arrays import Float
from enliven.formats.gltf.file import GltfFile, matrices_of
from enliven.rotation import unit

_LONGEST_STEP = 1 / 24
"""Seconds between samples at most: over a longer step world turns would bend between frames."""
_SHORTEST_STEP = 1 / 120
"""Seconds between samples at least: denser keys are no visible motion and cost memory."""
MOST_PLACES = 1 << 23
"""Frames times nodes of all animations of a file, 2 GB of matrices: 46 min of 100 nodes at 30 a second."""


@dataclass
class Locals:
    """Each node's own translation (F, n, 3), rotation (F, n, 4) as (x, y, z, w) and scale (F, n, 3).

    A node that has a matrix instead keeps it in ``fixed`` (glTF: such a node is never animated).
    """

    translation: Float
    rotation: Float
    scale: Float
    fixed: dict[int, Float]


def rest_locals(file: GltfFile) -> Locals:
    """Returns the nodes' rest transforms as the file states them, F = 1."""
    nodes = file.document.nodes
    count = len(nodes)
    made = Locals(np.zeros((1, count, 3)), np.zeros((1, count, 4)), np.ones((1, count, 3)), {})
    made.rotation[..., 3] = 1.0
    for number, node in enumerate(nodes):
        if node.matrix is not None:
            made.fixed[number] = np.array(node.matrix, np.float64).reshape(4, 4).T
        if node.translation is not None:
            made.translation[0, number] = node.translation
        if node.rotation is not None:
            made.rotation[0, number] = node.rotation
        if node.scale is not None:
            made.scale[0, number] = node.scale
    return made


def world_matrices(file: GltfFile, locals_: Locals) -> Float:
    """(F, n, 4, 4) world_from_node."""
    local = matrices_of(locals_.translation, locals_.rotation, locals_.scale)
    for number, matrix in locals_.fixed.items():
        local[:, number] = matrix
    world, done = local.copy(), set[int]()
    for node in range(len(file.parents)):
        _settle(file.parents, world, local, done, node)
    return world


def _settle(parents: list[int], world: Float, local: Float, done: set[int], node: int) -> None:
    """Make the world matrices of a node, its parents' first (a file may have them in any order)."""
    waiting = [node]
    while waiting:
        at = waiting[-1]
        if at in done:
            waiting.pop()
        elif parents[at] < 0 or parents[at] in done:
            if parents[at] >= 0:
                world[:, at] = world[:, parents[at]] @ local[:, at]
            done.add(at)
            waiting.pop()
        else:
            waiting.append(parents[at])


def frame_times(file: GltfFile, animation: int) -> Float:
    """Returns (F,) the evenly spaced seconds of an animation's samples; evenly spaced keys fall on them."""
    keys = [_keys(file, s.input) for s in file.document.animations[animation].samplers]
    keys = [k for k in keys if len(k)]
    if not keys:
        return np.zeros(1)
    start, end = min(k[0] for k in keys), max(k[-1] for k in keys)
    gaps = [float(np.median(np.diff(k))) for k in keys if len(k) > 1]
    gap = max(min(gaps, default=_LONGEST_STEP), _SHORTEST_STEP)
    # A whole number of frames in the gap between two keys keeps the keys on frames.
    gap /= max(math.ceil(gap / _LONGEST_STEP - 1e-3), 1)
    steps = max(round(float(end - start) / gap), 1)
    if (steps + 1) * len(file.parents) > MOST_PLACES:
        raise file.wrong(f"an animation lasts {end - start:.3g} s, which is {steps + 1} frames: too many")
    return np.asarray(np.linspace(start, end, steps + 1) if end > start else np.array([start]))


def animated_locals(file: GltfFile, animation: int, times: Float) -> Locals:
    """Samples every channel of an animation at ``times`` (F,) seconds."""
    rest = rest_locals(file)
    count = len(times)
    made = Locals(
        np.repeat(rest.translation, count, 0),
        np.repeat(rest.rotation, count, 0),
        np.repeat(rest.scale, count, 0),
        rest.fixed,
    )
    found = file.document.animations[animation]
    for channel in found.channels:
        node, path = channel.target.node, channel.target.path
        if node is None or path not in ("translation", "rotation", "scale"):
            continue
        sampler = found.samplers[channel.sampler]
        values = np.asarray(file.accessor(sampler.output), np.float64)
        at = sampled(_keys(file, sampler.input), values, sampler.interpolation or "LINEAR", path, times)
        getattr(made, path)[:, node] = at
        made.fixed.pop(node, None)
    return made


def _keys(file: GltfFile, accessor: int) -> Float:
    keys = np.asarray(file.accessor(accessor)[:, 0], np.float64)
    if not np.isfinite(keys).all() or (np.diff(keys) < 0).any():
        raise file.wrong("the times of an animation do not rise")
    return keys


def sampled(keys: Float, values: Float, interpolation: str, path: str, times: Float) -> Float:
    """Returns (F, C) a channel at ``times``, as glTF 2.0 appendix C defines it; the ends are held.

    Args:
        keys: (K,) seconds.
        values: (K, C), or (3K, C) of in-tangent, value, out-tangent for CUBICSPLINE.
    """
    cubic = interpolation == "CUBICSPLINE"
    points = values[1::3] if cubic else values
    if len(keys) == 1:
        return np.repeat(points[:1], len(times), 0)
    times = np.clip(times, keys[0], keys[-1])
    before = np.clip(np.searchsorted(keys, times, "right") - 1, 0, len(keys) - 2)
    span = np.maximum(keys[before + 1] - keys[before], 1e-12)
    share = np.clip((times - keys[before]) / span, 0.0, 1.0)
    if interpolation == "STEP":
        return np.asarray(points[np.where(share >= 1.0, before + 1, before)])
    if cubic:
        made = _hermite(values, before, span[:, None], share[:, None])
        return unit(made) if path == "rotation" else made
    if path == "rotation":
        # slerp does not mind which component is w, as long as both quaternions have it at the same place.
        a, b = unit(points[before]), unit(points[before + 1])
        return np.roll(rotation.slerp(np.roll(a, 1, -1), np.roll(b, 1, -1), share), -1, -1)
    return np.asarray(points[before] + share[:, None] * (points[before + 1] - points[before]))


def _hermite(values: Float, before: np.ndarray, span: Float, s: Float) -> Float:  # type: ignore[type-arg]
    """(F, C) the cubic through two keys with their tangents."""
    p0, out = values[3 * before + 1], span * values[3 * before + 2]
    p1, into = values[3 * before + 4], span * values[3 * before + 3]
    return np.asarray(
        (2 * s**3 - 3 * s**2 + 1) * p0
        + (s**3 - 2 * s**2 + s) * out
        + (3 * s**2 - 2 * s**3) * p1
        + (s**3 - s**2) * into
    )
