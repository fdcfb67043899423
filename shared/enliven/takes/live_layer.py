"""Plays a live pose as an additional layer on a shape's motion, as a preview of a recording."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Pose, Project, RiggedCharacter, unused
from enliven.motion.layers.evaluate import Player, pose_from
from enliven.motion.layers.retarget import bind_chain, clear_chain
from enliven.rotation import IDENTITY, conjugate, from_matrix, multiply


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
