"""Converts the cubic keys of a glTF animation from the file's nodes to the bones of the model.

A bone rotates relative to its parent by D_parent^-1 D = B_m W_m^-1 W_n B_n^-1. Here n and m are the nodes
that the bone and its parent follow, W are their world rotations, and B their world rotations in the bind
pose. If exactly one node q between m and n is animated, D_parent^-1 D = a q c with constant unit quaternions
a and c. Hermite interpolation of q is linear in its keys and slopes, so a q c is also a Hermite curve. Its
keys and slopes are those of q, multiplied by a from the left and by c from the right. The factors a and c are
unit quaternions, so they do not affect the normalisation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, CubicKeys
from enliven.formats.rig.rig_tree import Tree
from enliven.meshes.gltf.bind import Bind
from enliven.meshes.gltf.file import GltfFile, compose_matrices
from enliven.meshes.gltf.motion import sample_animated_locals
from enliven.meshes.gltf.surface import GltfSurface
from enliven.rotation import conjugate, from_matrix, multiply

_MAX_SCALE_DIFFERENCE = 1e-5
"""Maximum relative difference between the scales along the three axes of a uniformly scaled node."""
_MAX_CONSTANT_CHANGE = 1e-9
"""Maximum change of a value in a constant channel. It is below the resolution of float32."""
_MAX_QUATERNION_LENGTH_ERROR = 1e-3
"""Maximum deviation of a quaternion's length from 1 in the file. It allows for the rounding of small
integers."""
_MAX_CURVE_DEVIATION = 1e-4
"""Maximum deviation of a curve from its clip's frames, in radians or as a fraction of the skeleton's size."""


def add_cubic_keys(
    clip: Clip, animation: int, start: float, surface: GltfSurface, tree: Tree, chosen: list[int]
) -> Clip:
    """Adds those cubic keys of an animation to its clip that can be converted to bones.

    Args:
        clip: the clip.
        animation: its number in the file.
        start: time in the file at which the clip begins, in seconds.
        surface: the surface of the file, with its bind pose.
        tree: the bones, and the body that drives each bone.
        chosen: the node of each body.
    """
    file, bind = surface.file, surface.bind
    channels = _find_moving_samplers(file, animation)
    stretched = clip.strains is not None or clip.mirrors is not None
    if stretched or not any(
        _is_cubic(sampler) for samplers in channels.values() for sampler in samplers.values()
    ):
        return clip
    local = _local_transforms(file, animation)
    curves = list[CubicKeys]()
    for bone, driver in enumerate(tree.driver):
        above = chosen[tree.driver[clip.skeleton.parents[bone]]] if bone else -1
        keys = _compute_relative_rotation(file, channels, local, bind, (above, chosen[driver]))
        if keys is not None and (np.diff(keys[0]) > 0.0).all():
            curves.append(CubicKeys(bone, keys[0] - start, *keys[1:]))
    keys = _compute_world_translation(file, channels, local, chosen[tree.root])
    if keys is not None and (np.diff(keys[0]) > 0.0).all():
        curves.append(CubicKeys(0, keys[0] - start, *keys[1:]))
    return _check_curves(clip, curves)


def _is_cubic(sampler: Any) -> bool:
    return bool(sampler.interpolation == "CUBICSPLINE")


def _find_moving_samplers(file: GltfFile, animation: int) -> dict[int, dict[str, Any]]:
    """Returns the samplers with changing values, by node and path."""
    animation_entry = file.document.animations[animation]
    samplers: dict[int, dict[str, Any]] = {}
    for channel in animation_entry.channels or []:
        node, path = channel.target.node, channel.target.path
        if node is None or path not in ("translation", "rotation", "scale"):
            continue
        sampler = animation_entry.samplers[channel.sampler]
        values = file.keys(sampler, path)
        points = values[1::3] if _is_cubic(sampler) else values
        changes = np.ptp(points, axis=0).max() > _MAX_CONSTANT_CHANGE
        if changes or (
            _is_cubic(sampler) and len(points) > 1 and np.abs(values[[0, 2]]).max() > _MAX_CONSTANT_CHANGE
        ):
            samplers.setdefault(node, {})[path] = sampler
    return samplers


def _local_transforms(file: GltfFile, animation: int) -> Float:
    """Returns the nodes' local transforms (n, 4, 4) at time 0. Transforms of nodes without animation never
    change.
    """
    first_frame = sample_animated_locals(file, animation, np.zeros(1))
    local: Float = compose_matrices(first_frame.translation, first_frame.rotation, first_frame.scale)[0]
    for node, matrix in first_frame.fixed.items():
        local[node] = matrix
    return np.asarray(local)


def _compute_relative_rotation(
    file: GltfFile,
    channels: Mapping[int, Mapping[str, Any]],
    local: Float,
    bind: Bind,
    ends: tuple[int, int],
) -> tuple[Float, Float, Float] | None:
    """Returns times (K,), values (K, 4) and slopes (K, 2, 4) of a node's rotation relative to an ancestor. -1
    as ancestor means the world.

    Returns None unless exactly one node between them rotates with cubic keys, and no node changes its scale.
    """
    above, node = ends
    node_path = _node_path(file, above, node)
    rotating_nodes = [way_node for way_node in node_path if "rotation" in channels.get(way_node, {})]
    if len(rotating_nodes) != 1 or any("scale" in channels.get(way_node, {}) for way_node in node_path):
        return None
    (mover,) = rotating_nodes
    sampler = channels[mover]["rotation"]
    mover_index = node_path.index(mover)
    parent_rotation, after = (
        _rotation_from_transform(_transform_product(local, node_path[:mover_index])),
        _rotation_from_transform(_transform_product(local, node_path[mover_index + 1 :])),
    )
    from_bind, to_bind = (
        _rotation_from_transform(bind.world[node]),
        _rotation_from_transform(np.eye(4) if above < 0 else bind.world[above]),
    )
    if parent_rotation is None or after is None or from_bind is None or to_bind is None:
        return None
    if not _is_cubic(sampler) or _rotation_from_transform(local[mover]) is None:
        return None
    left_factor, right_factor = multiply(to_bind, parent_rotation), multiply(after, conjugate(from_bind))
    seconds, values, slopes = _sampler_keys(file, sampler, "rotation")
    values, slopes = np.roll(values, 1, -1), np.roll(slopes, 1, -1)
    if np.abs(np.linalg.norm(values, axis=1) - 1.0).max() > _MAX_QUATERNION_LENGTH_ERROR:
        return None
    return (
        seconds,
        multiply(multiply(left_factor, values), right_factor),
        multiply(multiply(left_factor, slopes), right_factor),
    )


def _compute_world_translation(
    file: GltfFile, channels: Mapping[int, Mapping[str, Any]], local: Float, node: int
) -> tuple[Float, Float, Float] | None:
    """Returns times (K,), values (K, 3) and slopes (K, 2, 3) of a node's world position.

    Returns None if one of its ancestors moves, or if the position has no cubic keys.
    """
    node_path = _node_path(file, -1, node)
    sampler = channels.get(node, {}).get("translation")
    if sampler is None or not _is_cubic(sampler) or any(ancestor in channels for ancestor in node_path[:-1]):
        return None
    parent_world = _transform_product(local, node_path[:-1])
    seconds, values, slopes = _sampler_keys(file, sampler, "translation")
    return seconds, values @ parent_world[:3, :3].T + parent_world[:3, 3], slopes @ parent_world[:3, :3].T


def _sampler_keys(file: GltfFile, sampler: Any, path: str) -> tuple[Float, Float, Float]:
    """Returns the seconds (K,), values (K, C) and slopes (K, 2, C) of a cubic sampler."""
    rows = file.keys(sampler, path)
    rows = rows.reshape(-1, 3, rows.shape[1])
    return np.asarray(file.accessor(sampler.input)[:, 0], np.float64), rows[:, 1], rows[:, ::2]


def _node_path(file: GltfFile, above: int, node: int) -> list[int]:
    """Returns the nodes on the path down to ``node``. It starts below the ancestor ``above``, or at the root
    if ``above`` is not an ancestor."""
    nodes_up = list[int]()
    while node >= 0 and node != above:
        nodes_up.append(node)
        node = file.parents[node]
    return nodes_up[::-1]


def _transform_product(local: Float, nodes: list[int]) -> Float:
    product = np.eye(4)
    for node in nodes:
        product = product @ local[node]
    return product


def _rotation_from_transform(matrix: Float) -> Float | None:
    """Returns the rotation (4,) of a transform, or None if it scales non-uniformly or mirrors."""
    linear = matrix[:3, :3]
    size = np.cbrt(np.linalg.det(linear))
    if not size > 0.0 or np.abs(linear.T @ linear / size**2 - np.eye(3)).max() > _MAX_SCALE_DIFFERENCE:
        return None
    return np.asarray(from_matrix(linear / size))


def _check_curves(clip: Clip, curves: list[CubicKeys]) -> Clip:
    """Adds the converted curves to the clip, except for curves that differ from one of its frames."""
    parents, finest = clip.skeleton.parents, clip.finest_motion
    even = np.arange(len(clip.turns), dtype=np.float64) * clip.step
    seconds: Float = np.asarray(even if clip.fine is None else clip.fine.seconds, np.float64)
    agreeing = list[CubicKeys]()
    size = max(float(clip.skeleton.lengths.sum()), 1e-9)
    for curve in curves:
        values = curve.evaluate(seconds)
        if curve.turns:
            turns = finest.turns[:, curve.bone]
            if curve.bone:
                turns = multiply(conjugate(finest.turns[:, parents[curve.bone]]), turns)
            deviation = 2.0 * np.arccos(np.clip(np.abs((values * turns).sum(1)), 0.0, 1.0)).max()
        else:
            deviation = np.abs(values - finest.root).max() / size
        if deviation < _MAX_CURVE_DEVIATION:
            agreeing.append(curve)
    return replace(clip, cubic=tuple(agreeing)) if agreeing else clip
