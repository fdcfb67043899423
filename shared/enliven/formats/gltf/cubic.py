"""The cubic keys of a glTF animation, carried from the file's nodes to the bones that are made of them.

A bone turns by D_parent^-1 D = B_m W_m^-1 W_n B_n^-1, with the world turns W of the nodes n and m that the
bone and the one before it follow, and B those of the bind pose. If one node between them is animated, that is
a q c with constant unit quaternions a and c. Hermite's interpolation of q is linear in its keys and slopes,
so a q c is the curve with the keys and slopes a (.) c; a and c do not change the length that is normalised.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, CubicKeys
from enliven.formats.rig import Tree
from enliven.meshes.gltf import Bind, GltfFile, GltfSurface, animated_locals, matrices_of
from enliven.rotation import conjugate, from_matrix, multiply

_EVEN = 1e-5
"""Relative difference of the sizes along three axes within which a node is scaled evenly."""
_STILL = 1e-9
"""Maximum change of a channel's value that counts as no motion. It is below the resolution of float32."""
_UNIT = 1e-3
"""By how much the length of a quaternion of the file may differ from 1: rounding of small integers."""
_SAME = 1e-4
"""Maximum deviation of a curve from the frames of its clip, in radians or as a fraction of the skeleton's
length."""


def with_cubic_keys(
    clip: Clip, animation: int, start: float, surface: GltfSurface, tree: Tree, chosen: list[int]
) -> Clip:
    """Returns the clip with the cubic keys of its animation that its bones can have.

    Args:
        start: seconds of the file at which the clip begins.
        chosen: the node of each body.
    """
    file, bind = surface.file, surface.bind
    channels = _moving(file, animation)
    stretched = clip.strains is not None or clip.mirrors is not None
    if stretched or not any(_is_cubic(one) for own in channels.values() for one in own.values()):
        return clip
    local = _local(file, animation)
    made = list[CubicKeys]()
    for bone, driver in enumerate(tree.driver):
        above = chosen[tree.driver[clip.skeleton.parents[bone]]] if bone else -1
        keys = _turning(file, channels, local, bind, (above, chosen[driver]))
        if keys is not None and (np.diff(keys[0]) > 0.0).all():
            made.append(CubicKeys(bone, keys[0] - start, *keys[1:]))
    keys = _travelling(file, channels, local, chosen[tree.root])
    if keys is not None and (np.diff(keys[0]) > 0.0).all():
        made.append(CubicKeys(0, keys[0] - start, *keys[1:]))
    return _checked(clip, made)


def _is_cubic(sampler: Any) -> bool:
    return bool(sampler.interpolation == "CUBICSPLINE")


def _moving(file: GltfFile, animation: int) -> dict[int, dict[str, Any]]:
    """The samplers that change something, by node and path."""
    found = file.document.animations[animation]
    made: dict[int, dict[str, Any]] = {}
    for channel in found.channels or []:
        node, path = channel.target.node, channel.target.path
        if node is None or path not in ("translation", "rotation", "scale"):
            continue
        sampler = found.samplers[channel.sampler]
        values = file.keys(sampler, path)
        points = values[1::3] if _is_cubic(sampler) else values
        changes = np.ptp(points, axis=0).max() > _STILL
        if changes or (_is_cubic(sampler) and len(points) > 1 and np.abs(values[[0, 2]]).max() > _STILL):
            made.setdefault(node, {})[path] = sampler
    return made


def _local(file: GltfFile, animation: int) -> Float:
    """(n, 4, 4) the transforms of nodes when an animation begins; those of still nodes are the same later."""
    at = animated_locals(file, animation, np.zeros(1))
    local: Float = matrices_of(at.translation, at.rotation, at.scale)[0]
    for node, matrix in at.fixed.items():
        local[node] = matrix
    return np.asarray(local)


def _turning(
    file: GltfFile,
    channels: Mapping[int, Mapping[str, Any]],
    local: Float,
    bind: Bind,
    ends: tuple[int, int],
) -> tuple[Float, Float, Float] | None:
    """The seconds, values and slopes of the turn of a node in one above it (-1: the world); or None."""
    above, node = ends
    way = _way(file, above, node)
    turned = [one for one in way if "rotation" in channels.get(one, {})]
    if len(turned) != 1 or any("scale" in channels.get(one, {}) for one in way):
        return None
    (mover,) = turned
    sampler = channels[mover]["rotation"]
    at = way.index(mover)
    before, after = _turn(_product(local, way[:at])), _turn(_product(local, way[at + 1 :]))
    from_bind, to_bind = _turn(bind.world[node]), _turn(np.eye(4) if above < 0 else bind.world[above])
    if before is None or after is None or from_bind is None or to_bind is None:
        return None
    if not _is_cubic(sampler) or _turn(local[mover]) is None:
        return None
    left, right = multiply(to_bind, before), multiply(after, conjugate(from_bind))
    seconds, values, slopes = _keys(file, sampler, "rotation")
    values, slopes = np.roll(values, 1, -1), np.roll(slopes, 1, -1)
    if np.abs(np.linalg.norm(values, axis=1) - 1.0).max() > _UNIT:
        return None
    return seconds, multiply(multiply(left, values), right), multiply(multiply(left, slopes), right)


def _travelling(
    file: GltfFile, channels: Mapping[int, Mapping[str, Any]], local: Float, node: int
) -> tuple[Float, Float, Float] | None:
    """The seconds, values and slopes of a node's place in the world; None if something above it moves."""
    way = _way(file, -1, node)
    sampler = channels.get(node, {}).get("translation")
    if sampler is None or not _is_cubic(sampler) or any(one in channels for one in way[:-1]):
        return None
    whole = _product(local, way[:-1])
    seconds, values, slopes = _keys(file, sampler, "translation")
    return seconds, values @ whole[:3, :3].T + whole[:3, 3], slopes @ whole[:3, :3].T


def _keys(file: GltfFile, sampler: Any, path: str) -> tuple[Float, Float, Float]:
    """(K,) seconds, (K, C) values and (K, 2, C) slopes of a cubic sampler."""
    rows = file.keys(sampler, path)
    rows = rows.reshape(-1, 3, rows.shape[1])
    return np.asarray(file.accessor(sampler.input)[:, 0], np.float64), rows[:, 1], rows[:, ::2]


def _way(file: GltfFile, above: int, node: int) -> list[int]:
    """The nodes from below one to another; all up to the world if the first is not above the other."""
    way = list[int]()
    while node >= 0 and node != above:
        way.append(node)
        node = file.parents[node]
    return way[::-1]


def _product(local: Float, nodes: list[int]) -> Float:
    made = np.eye(4)
    for node in nodes:
        made = made @ local[node]
    return made


def _turn(matrix: Float) -> Float | None:
    """(4,) the turn of a transform that scales evenly and does not mirror; else None."""
    linear = matrix[:3, :3]
    size = np.cbrt(np.linalg.det(linear))
    if not size > 0.0 or np.abs(linear.T @ linear / size**2 - np.eye(3)).max() > _EVEN:
        return None
    return np.asarray(from_matrix(linear / size))


def _checked(clip: Clip, made: list[CubicKeys]) -> Clip:
    """The clip with those curves that are at its frames where it is, all of them."""
    parents, finest = clip.skeleton.parents, clip.finest
    even = np.arange(len(clip.turns), dtype=np.float64) * clip.step
    seconds: Float = np.asarray(even if clip.fine is None else clip.fine.seconds, np.float64)
    kept = list[CubicKeys]()
    size = max(float(clip.skeleton.lengths.sum()), 1e-9)
    for one in made:
        at = one.at(seconds)
        if one.turns:
            turns = finest.turns[:, one.bone]
            if one.bone:
                turns = multiply(conjugate(finest.turns[:, parents[one.bone]]), turns)
            off = 2.0 * np.arccos(np.clip(np.abs((at * turns).sum(1)), 0.0, 1.0)).max()
        else:
            off = np.abs(at - finest.root).max() / size
        if off < _SAME:
            kept.append(one)
    return replace(clip, cubic=tuple(kept)) if kept else clip
