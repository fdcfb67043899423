"""A live pose as one more layer over what a shape plays: what a recording of it is going to look like."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Pose, Project, Shape, unused
from enliven.motion.layers import Player, bind_chain, clear_chain, pose_from
from enliven.rotation import IDENTITY, conjugate, from_matrix, multiply


class LiveLayer:
    """Plays a shape of a project with the pose of a moment on top, or in the place of what it plays.

    It holds what the project was when it was made: after an edit, make another.

    Args:
        replaced: joints of the bones that lose the layers that they have.
    """

    def __init__(self, project: Project, shape_id: str, replaced: frozenset[int] = frozenset()) -> None:
        self.shape = shape = project.shape(shape_id)
        still = np.tile(IDENTITY, (1, len(shape.skeleton), 1))
        take = Clip(unused("live", project.takes), shape.skeleton, still, shape.skeleton.positions[:1], 1.0)
        self._take = take.id
        project = project.with_takes(take)
        for joint in range(len(shape.skeleton)):
            chain = own_chain(shape, joint)
            if joint in replaced:
                project = clear_chain(project, shape_id, chain)
            project = bind_chain(project, shape_id, chain, take.id, chain, basis=IDENTITY)
        self._player = Player(project, shape_id)

    def pose(self, live: Pose, seconds: float, *, heard: bool = True) -> tuple[Pose, Float]:
        """Returns the pose at a time of the project, where the live one stands, and its (N, 3) joints.

        Args:
            heard: whether what is done live counts; else the shape only plays, in that place.
        """
        shape, rest = self.shape, self.shape.skeleton.positions[0] + self.shape.place
        own = np.tile(IDENTITY, (1, len(shape.skeleton), 1))
        if heard:
            own = own_turns(shape, from_matrix(live.linear.astype(np.float64))[None])
        turns = composed(shape.skeleton.parents, own)[0]
        self._player.feed(self._take, turns, shape.skeleton.positions[0])
        at = self._player.at(seconds)
        pose, shift = pose_from(shape, at, seconds), live.positions[0].astype(np.float64) - rest
        placed = (pose.positions + shift).astype(np.float32)
        return Pose(shape.id, live.time_ns, pose.linear, placed), at.joints + shift


def own_chain(shape: Shape, joint: int) -> tuple[int, ...]:
    """Returns the chain of one bone alone: its parent and the joint, or the root."""
    return (int(shape.skeleton.parents[joint]), joint) if joint else (0,)


def own_turns(shape: Shape, turns: Float) -> Float:
    """Returns (G, N, 4) what layers turned each bone, for turns (G, N, 4) in the world."""
    own = np.empty_like(turns)
    for j, parent in enumerate(shape.skeleton.parents):
        within = turns[:, j] if parent < 0 else multiply(conjugate(turns[:, parent]), turns[:, j])
        own[:, j] = multiply(conjugate(shape.modeling[j]), within)
    return own


def composed(parents: np.ndarray, own: Float) -> Float:
    """Returns (G, N, 4) turns in the world of turns (G, N, 4) against the parent."""
    turns = own.copy()
    for j, parent in enumerate(parents):
        if parent >= 0:
            turns[:, j] = multiply(turns[:, parent], own[:, j])
    return turns
