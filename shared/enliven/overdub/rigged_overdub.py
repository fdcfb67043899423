"""Overdub of a rigged character: plays a live pose as an additional layer on its motion, and adds recorded
layers to the bones that moved.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Pose, Project, RiggedCharacter, unused
from enliven.modeling.possessed.even_steps import resample_evenly
from enliven.motion.layers.evaluate import Player, pose_from
from enliven.motion.layers.retarget import bind_chain, clear_chain, set_travel
from enliven.overdub.performance import MIN_MOTION, PerformedCharacter
from enliven.overdub.punch_in import PunchIn, punch_bones
from enliven.rotation import IDENTITY, conjugate, from_matrix, multiply, remove_sign_jumps

_MIN_ROTATION_RADIANS = 0.01
"""Minimum rotation of a bone, radians (half a degree). Transmitted rotations have finer steps."""


class LiveLayer:
    """A player of a project's shape that adds a live pose to the existing motion, or replaces the motion by
    the live pose.

    It evaluates the version of the project that it was created with. After an edit, create a new player.

    Args:
        replaced: the bones, given by their joints. The live pose replaces their existing layers.
    """

    def __init__(self, project: Project, shape_id: str, replaced: frozenset[int] = frozenset()) -> None:
        self.shape = shape = project.shape(shape_id)
        identity_frame = np.tile(IDENTITY, (1, len(shape.skeleton), 1))
        take = Clip(
            unused("live", project.takes), shape.skeleton, identity_frame, shape.skeleton.positions[:1], 1.0
        )
        self._take = take.id
        project = project.with_takes(take)
        for joint in range(len(shape.skeleton)):
            chain = make_single_bone_chain(shape, joint)
            if joint in replaced:
                project = clear_chain(project, shape_id, chain)
            project = bind_chain(project, shape_id, chain, take.id, chain, basis=IDENTITY)
        self._player = Player(project, shape_id)

    def pose(self, live: Pose, seconds: float, *, heard: bool = True) -> tuple[Pose, Float]:
        """Returns the pose at a time of the project, moved to the position of the live pose, and its joints
        (N, 3).

        Args:
            heard: True if the live pose is applied. If False, the shape plays only its own motion, at the
                position of the live pose.
        """
        shape, rest = self.shape, self.shape.skeleton.positions[0] + self.shape.place
        local_turns = np.tile(IDENTITY, (1, len(shape.skeleton), 1))
        if heard:
            local_turns = local_rotations(shape, from_matrix(live.linear.astype(np.float64))[None])
        turns = compose_rotations(shape.skeleton.parents, local_turns)[0]
        self._player.feed(self._take, turns, shape.skeleton.positions[0])
        own_pose = self._player.compute_pose(seconds)
        pose, shift = pose_from(shape, own_pose, seconds), live.positions[0].astype(np.float64) - rest
        moved_positions = (pose.positions + shift).astype(np.float32)
        return Pose(shape.id, live.time_ns, pose.linear, moved_positions), own_pose.joints + shift


def make_single_bone_chain(shape: RiggedCharacter, joint: int) -> tuple[int, ...]:
    """Returns the chain of a single bone: its parent and the joint, or the root."""
    return (int(shape.skeleton.parents[joint]), joint) if joint else (0,)


def local_rotations(shape: RiggedCharacter, turns: Float) -> Float:
    """Computes the rotations (G, N, 4) that the layers of each bone must produce to reach the world rotations
    ``turns`` (G, N, 4).
    """
    local = np.empty_like(turns)
    for j, parent in enumerate(shape.skeleton.parents):
        relative = turns[:, j] if parent < 0 else multiply(conjugate(turns[:, parent]), turns[:, j])
        local[:, j] = multiply(conjugate(shape.modeling[j]), relative)
    return local


def compose_rotations(parents: np.ndarray, local: Float) -> Float:
    """Computes world rotations (G, N, 4) from rotations (G, N, 4) relative to the parent."""
    turns = local.copy()
    for j, parent in enumerate(parents):
        if parent >= 0:
            turns[:, j] = multiply(turns[:, parent], local[:, j])
    return turns


def add_bone_layers(project: Project, shape: RiggedCharacter, motion: PerformedCharacter) -> Project | None:
    """Adds a layer to those bones of a shape that moved. Returns None if the performed character has another
    skeleton.
    """
    performed, replaces = motion.performed, motion.replaces
    if len(shape.skeleton) != len(motion.poses[0].positions):
        return None
    linear, positions, grid = resample_evenly(motion.character, motion.poses, motion.begin)
    root = positions[:, 0]
    local_turns = local_rotations(shape, from_matrix(linear))
    angles = 2 * np.arccos(np.minimum(np.abs(local_turns[:, :, 0]).min(0), 1.0))
    moved_bones = np.flatnonzero(angles > _MIN_ROTATION_RADIANS).tolist()
    travels = bool(np.ptp(root, axis=0).max() > MIN_MOTION)
    chains = _moved_limbs(shape, moved_bones)
    take = Clip(
        unused(f"{performed.name} on {shape.id}", project.takes),
        shape.skeleton,
        remove_sign_jumps(compose_rotations(shape.skeleton.parents, local_turns)),
        root - root[0] + shape.skeleton.positions[0],
        float(grid[1] - grid[0]),
    )
    project = project.with_takes(take)
    punch = PunchIn.from_interval(project, float(grid[0]), float(grid[-1]))
    keeps_some = replaces and punch.moves_outside(project, shape.layers)
    for chain in chains:
        if replaces:
            project = punch_bones(project, shape.id, chain, punch)
        layer = unused(f"{take.id}: {shape.skeleton.names[chain[-1]]}", project.layer_names)
        layer_settings = {"basis": IDENTITY, "layer_id": layer, "offset": float(grid[0])}
        played = punch.playback_settings if keeps_some else {}
        project = bind_chain(project, shape.id, chain, take.id, chain, **layer_settings, **played)
    if travels and chains and ((replaces and not keeps_some) or shape.travel is None):
        last = project.shape(shape.id).layers[-len(chains)].id
        project = set_travel(project, shape.id, last, scale=1.0)
    return project


def _moved_limbs(shape: RiggedCharacter, moved: Sequence[int]) -> list[tuple[int, ...]]:
    """Returns the chains of the bones that moved. A chain continues while exactly one child bone moved."""
    chains, child_bones = list[tuple[int, ...]](), shape.skeleton.children
    for joint in moved:
        ended = [
            n
            for n, chain in enumerate(chains)
            if chain[-1] == make_single_bone_chain(shape, joint)[0] and chain != (0,)
        ]
        if joint and ended and len(set(child_bones[chains[ended[0]][-1]]) & set(moved)) == 1:
            chains[ended[0]] = (*chains[ended[0]], joint)
        else:
            chains.append(make_single_bone_chain(shape, joint))
    return chains
