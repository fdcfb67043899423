"""Converts a skeleton for a GLB: joint names, local rotations, normalised weights, colours and normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Float32, UInt16
from enliven.document import Skeleton
from enliven.examples.baking import stretch_axes
from enliven.rotation import conjugate, from_matrix, multiply, normalized, remove_sign_jumps, to_matrix


def bone_names(skeleton: Skeleton) -> list[str]:
    """Names each bone after its start joint.

    If several bones start at the joint, the names of all but one also contain their target.
    """
    named = []
    for j, parent in enumerate(skeleton.parents):
        if j == 0:
            named.append(skeleton.names[0])
            continue
        onward = parent > 0 and j == _straightest_child(skeleton, int(parent))
        begin, end = skeleton.names[parent], skeleton.names[j]
        named.append(begin if onward else f"{begin} to {end}")
    return named


def _straightest_child(skeleton: Skeleton, joint: int) -> int:
    """Returns the child that continues a joint's bone in the straightest line."""
    into = skeleton.vectors[joint]

    def straight(child: int) -> float:
        out = skeleton.vectors[child]
        return float(into @ out / max(float(np.linalg.norm(into) * np.linalg.norm(out)), 1e-12))

    return max(skeleton.children[joint], key=straight)


def local_turns(skeleton: Skeleton, turns: Float) -> Float:
    """Returns rotations (T, N, 4) of bones relative to their parents, D_parent^-1 D, without sign jumps."""
    local = turns.copy()
    for j in range(1, len(skeleton)):
        local[:, j] = multiply(conjugate(turns[:, skeleton.parents[j]]), turns[:, j])
    return remove_sign_jumps(normalized(local))


def local_offsets(skeleton: Skeleton) -> Float:
    """Returns the rest offset (N, 3) in metres of each bone's start joint from that of its parent bone."""
    offsets = np.zeros((len(skeleton), 3))
    offsets[1:] = skeleton.vectors[skeleton.parents[1:]]
    return offsets


@dataclass(frozen=True, eq=False)
class LocalMotion:
    """The motion of the nodes of a skeleton's bones, each relative to its parent's node.

    Attributes:
        axes: (N, 3, 3) rotation of each node at rest, chosen so that its bone stretches along the node's
            axes.
        turns: (T, N, 4) quaternions without sign jumps.
        scales: (T, N, 3).
        places: (T, N, 3) metres, position of the node in its parent's node.
        ends: (T, N, 3) metres, position of the bone's end joint in its node.
    """

    axes: Float
    turns: Float
    scales: Float
    places: Float
    ends: Float


def local_motion(skeleton: Skeleton, linear: Float, joints: Float) -> LocalMotion:
    """Returns the motion of stretching nodes, for maps (T, N, 3, 3) and joints (T, N, 3) in the world.

    A node cannot shear. So a bone's shear relative to its parent is left out, but its children keep their
    transforms.
    """
    parents, above = skeleton.parents, np.maximum(skeleton.parents, 0)
    pivots, relative = joints[:, above], linear.copy()
    relative[:, 1:] = np.linalg.solve(linear[:, parents[1:]], linear[:, 1:])
    axes = stretch_axes(relative)
    turns, scales = np.empty((*joints.shape[:2], 4)), np.empty(joints.shape)
    places, ends, world = np.empty(joints.shape), np.empty(joints.shape), np.empty_like(linear)
    for j, parent in enumerate(parents):
        local, places[:, j] = linear[:, j] @ axes[j], pivots[:, j]
        if j:
            back = np.linalg.inv(world[:, parent])
            local = back @ local
            places[:, j] = np.einsum("tab,tb->ta", back, pivots[:, j] - pivots[:, parent])
        turns[:, j] = from_matrix(local * np.where(np.linalg.det(local) < 0, -1.0, 1.0)[:, None, None])
        turned = to_matrix(turns[:, j])
        scales[:, j] = np.einsum("tba,tba->ta", turned, local)
        world[:, j] = turned * scales[:, j, None, :]
        if j:
            world[:, j] = world[:, parent] @ world[:, j]
        ends[:, j] = np.linalg.solve(world[:, j], (joints[:, j] - pivots[:, j])[..., None])[..., 0]
    return LocalMotion(axes, remove_sign_jumps(turns), scales, places, ends)


def normalize_skin(indices: UInt16, weights: Float32) -> tuple[UInt16, Float32]:
    """Normalises (V, 4) skin weights for the format: no repeated bone, index 0 for weight 0, sums of one."""
    indices, exact = indices.copy(), np.maximum(weights.astype(np.float64), 0.0)
    for b in range(1, 4):
        for a in range(b):
            same = indices[:, a] == indices[:, b]
            exact[same, a] += exact[same, b]
            exact[same, b] = 0.0
    total = exact.sum(1, keepdims=True)
    exact = np.where(total > 0, exact / np.where(total > 0, total, 1.0), [[1.0, 0.0, 0.0, 0.0]])
    rounded = exact.astype(np.float32)
    indices[rounded == 0] = 0
    return indices, rounded


def listed(values: Float | Float32) -> list[float]:
    """Converts numbers to a JSON list. They are rounded to float32, which every reader accepts."""
    return [float(v) for v in np.asarray(values, np.float32)]


def normalize_float32(quaternions: Float) -> Float32:
    """Normalises quaternions in float32."""
    rounded = quaternions.astype(np.float32)
    length = np.linalg.norm(rounded.astype(np.float64), axis=-1, keepdims=True)
    return np.asarray(rounded / length, np.float32)
