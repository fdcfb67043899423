"""A character of any rig on the stage at one time: its transforms, its surface, and its handles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from enliven.arrays import Float, Float32
from enliven.deformation.skinning import skin_vertices
from enliven.document import Character, Pose, RigBase, Skeleton
from enliven.rotation import rotate


@dataclass(frozen=True, eq=False)
class StageCharacter:
    """A character at one time.

    Attributes:
        character: the shown character. It is an older version while the newest motion is being solved.
        drawn: its render mesh, or None if it has no surface.
        pose: the transforms of its current pose.
        handles: (H, 3) metres in the world, the positions of its joints or control points.
    """

    character: RigBase
    drawn: Character | None
    pose: Pose
    handles: Float

    has_own_tool = False
    """True if a special tool shows and edits its handles. All other tools ignore them."""

    @property
    def id(self) -> str:
        """Returns the id of the character."""
        return self.character.id

    @property
    def solved(self) -> Float32 | None:
        """Returns the vertices (V, 3) float32 in metres of the world if a solver has computed them. Returns
        None if the pose's transforms move the vertices.
        """
        return None

    @cached_property
    def vertices(self) -> Float:
        """Returns the vertices (V, 3) in metres of the world, or an empty result without a surface."""
        return np.zeros((0, 3)) if self.drawn is None else skin_vertices(self.drawn, self.pose).astype(float)

    @property
    def extent(self) -> Float | Float32:
        """Returns points (N, 3) in metres with about the character's extent. They are the points that are
        fastest to compute.
        """
        return (
            self.solved if self.solved is not None else self.handles if len(self.handles) else self.vertices
        )

    @cached_property
    def bones(self) -> tuple[tuple[int, int], ...]:
        """Returns the numbers of the handles at both ends of each bone, the parent first, or an empty result
        without bones.
        """
        parents = () if self.has_own_tool else enumerate(self.character.parents)
        return tuple((int(parent), handle) for handle, parent in parents if parent >= 0)

    @property
    def nodes(self) -> Float | Float32:
        """Returns the positions (N, 3) of the nodes that can have keys, in metres of the world. Returns an
        empty array if the handles have the keys instead.
        """
        count = 0 if len(self.handles) else self.character.keyable
        return self.pose.positions[:count]

    def on_bone(self, handle: int, along: float) -> Float:
        """Returns a point (3,) in metres on the bone that ends at a handle. ``along`` is 0 at the start of
        the bone and 1 at the handle.
        """
        start = self.handles[max(int(self.character.parents[handle]), 0)]
        return np.asarray(start + along * (self.handles[handle] - start))


def find_joints(skeleton: Skeleton, turns: Float, root: Float) -> Float:
    """Returns the joint positions (N, 3) in metres for world rotations (N, 4) and the root position (3,)."""
    joints = np.empty_like(skeleton.positions)
    joints[0] = root
    arms = rotate(turns, skeleton.vectors)
    for joint in range(1, len(skeleton)):
        joints[joint] = joints[skeleton.parents[joint]] + arms[joint]
    return joints
