"""Converts a skeleton to joints that rotate about their own position: names, rest transforms, tracks, skin
weights.

A bone of a :class:`Skeleton` rotates about its upper end. Joints in files of other programs rotate about
their own position. So bone j becomes a joint at its parent's position, and the end of a limb becomes a joint
without vertices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Float32, UInt16
from enliven.document import Skeleton
from enliven.examples.baking.maps import stretch_axes
from enliven.exporters.performance import Performance
from enliven.rotation import conjugate, from_matrix, multiply, normalized, remove_sign_jumps, to_matrix


@dataclass(frozen=True, eq=False)
class JointTracks:
    """Joints of a file, parents before children, with their motion relative to the parent joint.

    Attributes:
        names: names of the joints: first the bones, then the ends of limbs.
        parents: (J,) number of the parent joint, -1 for the root.
        bones: number of bones. The joints after them are ends of limbs.
        pivots: (J, 3) metres at rest, in the world.
        axes: (J, 3, 3) rotations at rest, in the world.
        offsets: (J, 3) metres at rest, position in the frame of the parent joint.
        rest: (J, 4) quaternions at rest, rotation relative to the parent joint.
        turns: (T, J, 4) quaternions without sign jumps.
        scales: (T, J, 3) scale factors along the axes.
        places: (T, J, 3) metres, position in the frame of the parent joint.
        stretches: False if only rotations and the root's position change.
    """

    names: list[str]
    parents: list[int]
    bones: int
    pivots: Float
    axes: Float
    offsets: Float
    rest: Float
    turns: Float
    scales: Float
    places: Float
    stretches: bool


def joint_tracks(performance: Performance, skeleton: Skeleton, half_scales: bool = False) -> JointTracks:
    """Returns the joints of a performance with a skeleton, and their tracks.

    Args:
        half_scales: True for a format that stores scales in float16. Other tracks then compensate the
            rounding.
    """
    frames, bones = len(performance.times), len(skeleton)
    ends = [j for j in range(1, bones) if not skeleton.children[j]]
    count = bones + len(ends)
    offsets, axes = np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1))
    turns, scales = np.zeros((frames, count, 4)), np.ones((frames, count, 3))
    turns[..., 0] = 1.0
    offsets[:bones], offsets[bones:] = local_offsets(skeleton), skeleton.vectors[ends]
    offsets[0] = skeleton.positions[0]
    stretches = performance.joints is not None and performance.stretches
    if stretches:
        assert performance.joints is not None
        motion = local_motion(skeleton, performance.linear, performance.joints, half_scales)
        axes[:bones], axes[bones:] = motion.axes, motion.axes[ends]
        offsets[1:bones] = np.einsum("nba,nb->na", motion.axes[skeleton.parents[1:]], offsets[1:bones])
        offsets[bones:] = np.einsum("nba,nb->na", motion.axes[ends], offsets[bones:])
        turns[:, :bones], scales[:, :bones] = motion.turns, motion.scales
        places = np.concatenate([motion.places, motion.ends[:, ends]], 1)
    else:
        turns[:, :bones] = local_rotations(skeleton, from_matrix(performance.linear))
        places = np.tile(offsets, (frames, 1, 1))
    places[:, 0] = performance.positions[:, 0]
    parents = [*skeleton.parents.tolist(), *ends]
    above = np.array(parents)
    relative = axes.copy()
    relative[1:] = axes[above[1:]].transpose(0, 2, 1) @ axes[1:]
    return JointTracks(
        names=[*bone_names(skeleton), *(skeleton.names[j] for j in ends)],
        parents=parents,
        bones=bones,
        pivots=np.concatenate([performance.pivots, skeleton.positions[ends]]),
        axes=axes,
        offsets=offsets,
        rest=from_matrix(relative),
        turns=turns,
        scales=scales,
        places=places,
        stretches=stretches,
    )


def bone_names(skeleton: Skeleton) -> list[str]:
    """Names each bone after its start joint.

    If several bones start at a joint, one bone gets the joint's name, and the names of the others also
    contain their target.
    """
    names = []
    for j, parent in enumerate(skeleton.parents):
        if j == 0:
            names.append(skeleton.names[0])
            continue
        onward = parent > 0 and j == _find_straightest_child(skeleton, int(parent))
        begin_name, end = skeleton.names[parent], skeleton.names[j]
        names.append(begin_name if onward else f"{begin_name} to {end}")
    return names


def _find_straightest_child(skeleton: Skeleton, joint: int) -> int:
    """Returns the child that continues a joint's bone in the straightest line."""
    into = skeleton.vectors[joint]

    def straight(child: int) -> float:
        direction = skeleton.vectors[child]
        return float(into @ direction / max(float(np.linalg.norm(into) * np.linalg.norm(direction)), 1e-12))

    return max(skeleton.children[joint], key=straight)


def local_rotations(skeleton: Skeleton, turns: Float) -> Float:
    """Converts world rotations D (T, N, 4) to rotations relative to the parent bones, D_parent^-1 D, without
    sign jumps."""
    local = turns.copy()
    for j in range(1, len(skeleton)):
        local[:, j] = multiply(conjugate(turns[:, skeleton.parents[j]]), turns[:, j])
    return remove_sign_jumps(normalized(local))


def local_offsets(skeleton: Skeleton) -> Float:
    """Returns the rest offset (N, 3) in metres from the start joint of the parent bone to each bone's start
    joint."""
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
        scales: (T, N, 3) scale factors along the axes.
        places: (T, N, 3) metres, position of the node in the frame of its parent's node.
        ends: (T, N, 3) metres, position of the bone's end joint in the frame of its node.
    """

    axes: Float
    turns: Float
    scales: Float
    places: Float
    ends: Float


def local_motion(skeleton: Skeleton, linear: Float, joints: Float, half_scales: bool = False) -> LocalMotion:
    """Returns the motion of nodes that may stretch, from linear maps (T, N, 3, 3) and joints (T, N, 3) in the
    world.

    A node cannot shear. So the shear of a bone relative to its parent is lost. Its children still get their
    exact transforms.

    Args:
        half_scales: True to round scales to float16.
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
        if half_scales:
            scales[:, j] = scales[:, j].astype(np.float16)
        world[:, j] = turned * scales[:, j, None, :]
        if j:
            world[:, j] = world[:, parent] @ world[:, j]
        ends[:, j] = np.linalg.solve(world[:, j], (joints[:, j] - pivots[:, j])[..., None])[..., 0]
    return LocalMotion(axes, remove_sign_jumps(turns), scales, places, ends)


def normalize_skin(indices: UInt16, weights: Float32) -> tuple[UInt16, Float32]:
    """Normalises skin weights (V, 4) for file formats. In the result, no bone is repeated, unused entries
    have index 0 and weight 0, and the weights of each vertex sum to one."""
    indices, exact_weights = indices.copy(), np.maximum(weights.astype(np.float64), 0.0)
    for b in range(1, 4):
        for a in range(b):
            is_same_bone = indices[:, a] == indices[:, b]
            exact_weights[is_same_bone, a] += exact_weights[is_same_bone, b]
            exact_weights[is_same_bone, b] = 0.0
    total = exact_weights.sum(1, keepdims=True)
    exact_weights = np.where(
        total > 0, exact_weights / np.where(total > 0, total, 1.0), [[1.0, 0.0, 0.0, 0.0]]
    )
    rounded_weights = exact_weights.astype(np.float32)
    indices[rounded_weights == 0] = 0
    return indices, rounded_weights


def json_numbers(values: Float | Float32) -> list[float]:
    """Converts numbers to a JSON list. They are rounded to float32, which every reader accepts."""
    return [float(v) for v in np.asarray(values, np.float32)]


def normalize_float32(quaternions: Float) -> Float32:
    """Normalises quaternions in float32."""
    rounded_quaternions = quaternions.astype(np.float32)
    length = np.linalg.norm(rounded_quaternions.astype(np.float64), axis=-1, keepdims=True)
    return np.asarray(rounded_quaternions / length, np.float32)
