"""A shape at one moment: the turns of its bones, its joints, and its pose for the renderer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Pose, Shape
from enliven.rotation import rotate, to_matrix


@dataclass(frozen=True, eq=False)
class PosedShape:
    """A shape at one moment.

    Attributes:
        shape: the shape in its rest pose.
        turns: (N, 4) unit quaternions D_j, world turns since rest.
        joints: (N, 3) metres.
    """

    shape: Shape
    turns: Float
    joints: Float

    def bones(self) -> tuple[Float, Float]:
        """Both ends, (N - 1, 3) metres each, of bones 1..N-1."""
        parents = self.shape.skeleton.parents[1:]
        return self.joints[parents], self.joints[1:]

    def pose(self) -> Pose:
        """The pose of the character that :func:`enliven.document.rigged.character_of` makes of the shape."""
        above = np.maximum(self.shape.skeleton.parents, 0)
        linear = to_matrix(self.turns).astype(np.float32)
        return Pose(self.shape.id, 0, linear, self.joints[above].astype(np.float32))

    def surface(self) -> Float:
        """(V, 3) metres of the mesh's vertices; empty without a mesh."""
        shape = self.shape
        if shape.mesh is None or shape.skin is None:
            return np.zeros((0, 3))
        above = np.maximum(shape.skeleton.parents, 0)
        linear, at = to_matrix(self.turns), self.joints[above]
        moved = np.zeros_like(shape.mesh.vertices)
        for k in range(4):
            bone, weight = shape.skin.indices[:, k], shape.skin.weights[:, k, None]
            arm = shape.mesh.vertices - shape.skeleton.positions[above][bone]
            moved += weight * (np.einsum("vab,vb->va", linear[bone], arm) + at[bone])
        return moved


def joints_of(shape: Shape, turns: Float, root: Float) -> Float:
    """(N, 3) metres of the joints for world turns (N, 4) and the root's place (3,)."""
    skeleton = shape.skeleton
    joints = np.empty_like(skeleton.positions)
    joints[0] = root
    arms = rotate(turns, skeleton.vectors)
    for joint in range(1, len(skeleton)):
        joints[joint] = joints[skeleton.parents[joint]] + arms[joint]
    return joints
