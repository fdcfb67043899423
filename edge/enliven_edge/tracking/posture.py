"""A posture of the model: where it is, how its frames turn, how long its bones are; forward kinematics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.rotation import from_matrix
from enliven_edge.tracking import model
from enliven_edge.tracking.kinematics import capsules_into, carry_on, forward_into, pivots_by_length


@dataclass
class Posture:
    """The unknowns of the fit.

    Attributes:
        position: (3,) metres, world frame, of the hip centre.
        rotations: (13, 3, 3) parent_from_frame.
        lengths: (12,) metres, ordered by ``model.LENGTHS``.
    """

    position: Float
    rotations: Float
    lengths: Float

    def copy(self) -> Posture:
        return Posture(self.position.copy(), self.rotations.copy(), self.lengths.copy())

    def joints(self) -> Float:
        """(20, 3) joint positions, world frame, metres."""
        world, pivots, _ = forward(self.position, self.rotations, self.lengths)
        offsets = model.JOINT_OFFSETS @ self.lengths
        return pivots[model.JOINT_FRAMES] + np.einsum("jab,jb->ja", world[model.JOINT_FRAMES], offsets)

    def orientations(self) -> Float:
        """(20, 4) unit quaternions world_from_bone of the bone that ends at each joint.

        All are the identity for a person who stands upright facing +Z with hanging arms: bones of the limbs
        lie along -Y of their frame, those of the trunk along +Y, and +Z is the person's front.
        """
        world, _, _ = forward(self.position, self.rotations, self.lengths)
        return from_matrix(world[model.BONE_FRAMES])

    def capsules(self) -> tuple[Float, Float]:
        """(C, 2, 3) capsule ends in the world frame and (C, 2) radii, metres."""
        world, pivots, _ = forward(self.position, self.rotations, self.lengths)
        shape = model.CAPSULES
        ends, radii = np.empty((len(shape.frame), 2, 3)), np.empty((len(shape.frame), 2))
        capsules_into(ends, radii, world, pivots, self.lengths, shape.frame, shape.ends, shape.radii)
        return ends, radii


def forward(position: Float, rotations: Float, lengths: Float) -> tuple[Float, Float, Float]:
    """World rotations (13, 3, 3), pivots (13, 3), and the pivots' derivatives by the lengths (13, 3, 12)."""
    world, pivots = np.empty((13, 3, 3)), np.empty((13, 3))
    by_length = np.empty((13, 3, len(lengths)))
    forward_into(world, pivots, position, rotations, lengths, model.FRAME_PARENTS, model.PIVOTS)
    pivots_by_length(by_length, world, rotations, model.FRAME_PARENTS, model.PIVOTS)
    return world, pivots, by_length


def rotation(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Float:
    """(3, 3) Rz(z) Ry(y) Rx(x): turns about the fixed x, then y, then z axis, radians."""
    cx, sx, cy, sy, cz, sz = np.cos(x), np.sin(x), np.cos(y), np.sin(y), np.cos(z), np.sin(z)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


_CARRY_ON = 0.8
_FASTEST_STEP, _FASTEST_TURN = 0.1, 0.25


def continued(before: Posture, now: Posture) -> Posture:
    """The posture one frame later if it moves on as it did, a little slower, at a person's speed at most."""
    made = now.copy()
    step = _CARRY_ON * (now.position - before.position)
    made.position += step * min(1.0, _FASTEST_STEP / max(1e-9, float(np.linalg.norm(step))))
    carry_on(made.rotations, before.rotations, _CARRY_ON, _FASTEST_TURN)
    return made
