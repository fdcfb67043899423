"""A posture of the body model: position, rotations and lengths, and its forward kinematics."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.kernels import copy_row, njit
from enliven.rotation import nearest_quaternion
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.kinematics import capsules_into, extrapolate, forward_into, product
from enliven_edge.tracking.body_model.model import CHEST, PELVIS

_BODY = (model.FRAME_PARENTS, model.PIVOTS)
"""The arguments of :func:`frames_of` that come from the model."""
_JOINTS = (model.JOINT_FRAMES, model.JOINT_OFFSETS)
"""The arguments of :func:`_joints` that come from the model."""
_SURFACE = (model.CAPSULES.frame, model.CAPSULES.ends, model.CAPSULES.radii)
"""The arguments of :func:`capsules_of` that come from the model."""


@dataclass
class Posture:
    """A posture of a body: the unknowns of the fit.

    Attributes:
        position: (3,) position of the hip centre in metres, world frame.
        rotations: (13, 3, 3) parent_from_frame.
        lengths: (12,) metres, ordered by ``model.LENGTHS``.
    """

    position: Float
    rotations: Float
    lengths: Float
    _cached_capsules: tuple[tuple[bytes, ...], tuple[Float, Float]] | None = field(
        default=None, init=False, repr=False, compare=False
    )

    def copy(self) -> Posture:
        """Returns a deep copy."""
        return Posture(self.position.copy(), self.rotations.copy(), self.lengths.copy())

    def joints(self) -> Float:
        """Returns (20, 3) joint positions, world frame, metres."""
        return np.asarray(_joints(self.position, self.rotations, self.lengths, *_BODY, *_JOINTS))

    def orientations(self) -> Float:
        """Returns (20, 4) unit quaternions world_from_bone of the bone that ends at each joint.

        All are the identity for a person who stands upright facing +Z with hanging arms. Bones of the limbs
        lie along -Y of their frame, those of the trunk along +Y, and +Z is the person's front.
        """
        state = (self.position, self.rotations, self.lengths)
        return np.asarray(_turns(*state, *_BODY, model.BONE_FRAMES))

    def capsules(self) -> tuple[Float, Float]:
        """Returns (C, 2, 3) capsule ends in the world frame and (C, 2) radii, metres. Do not modify them.

        The result is cached, because the posture is unchanged in half of the calls.
        """
        state = (self.position.tobytes(), self.rotations.tobytes(), self.lengths.tobytes())
        if self._cached_capsules is None or self._cached_capsules[0] != state:
            ends, radii = capsules_of(self.position, self.rotations, self.lengths, *_BODY, *_SURFACE)
            self._cached_capsules = state, (ends, radii)
        return self._cached_capsules[1]

    @property
    def lowest(self) -> float:
        """Returns the height in metres of the surface's lowest point above y = 0: the sole of a standing
        person."""
        ends, radii = self.capsules()
        return float((ends[..., 1] - radii).min())


def forward(position: Float, rotations: Float, lengths: Float) -> tuple[Float, Float]:
    """Returns world rotations (13, 3, 3) and pivots (13, 3) of the frames: forward kinematics."""
    world, pivots = frames_of(position, rotations, lengths, *_BODY)
    return world, pivots


@njit(cache=True, nogil=True)
def frames_of(position, rotations, lengths, parents, offsets):
    """Computes :func:`forward` in kernels.

    For the arguments see :func:`kinematics.forward_into`.
    """
    count = len(parents)
    world, pivots = np.empty((count, 3, 3)), np.empty((count, 3))
    forward_into(world, pivots, position, rotations, lengths, parents, offsets)
    return world, pivots


@njit(cache=True, nogil=True)
def joints_into(joints, world, pivots, lengths, frames, local):
    """Writes the (J, 3) world positions of points that are fixed to the body's frames into ``joints``.

    Args:
        joints: (J, 3) the output, metres.
        world, pivots: from :func:`frames_of`.
        lengths: (12,) metres.
        frames: (J,) the frame of each point.
        local: (J, 3, 12) its position in that frame, linear in the lengths.
    """
    for j in range(len(frames)):
        f = frames[j]
        for a in range(3):
            joints[j, a] = pivots[f, a]
        for b in range(3):
            along = 0.0
            for term in range(len(lengths)):
                along += local[j, b, term] * lengths[term]
            for a in range(3):
                joints[j, a] += world[f, a, b] * along


@njit(cache=True, nogil=True)
def _joints(position, rotations, lengths, parents, offsets, frames, local):
    """Computes the (20, 3) result of :meth:`Posture.joints`."""
    world, pivots = frames_of(position, rotations, lengths, parents, offsets)
    joints = np.empty((len(frames), 3))
    joints_into(joints, world, pivots, lengths, frames, local)
    return joints


@njit(cache=True, nogil=True)
def _turns(position, rotations, lengths, parents, offsets, bones):
    """Computes the (20, 4) result of :meth:`Posture.orientations`, with w >= 0. ``bones`` contains the frame
    of each bone.
    """
    world, _ = frames_of(position, rotations, lengths, parents, offsets)
    turns, out = np.empty((len(world), 4)), np.empty((len(bones), 4))
    for f in range(len(world)):
        w, x, y, z = nearest_quaternion(world[f])
        side = -1.0 if w < 0.0 else 1.0
        turns[f, 0], turns[f, 1], turns[f, 2], turns[f, 3] = side * w, side * x, side * y, side * z
    for j in range(len(bones)):
        copy_row(out[j], turns[bones[j]])
    return out


@njit(cache=True, nogil=True)
def capsules_of(position, rotations, lengths, parents, offsets, frames, local, thickness):
    """Computes :meth:`Posture.capsules`. For the arguments see :func:`kinematics.capsules_into`."""
    world, pivots = frames_of(position, rotations, lengths, parents, offsets)
    ends, radii = np.empty((len(frames), 2, 3)), np.empty((len(frames), 2))
    capsules_into(ends, radii, world, pivots, lengths, frames, local, thickness)
    return ends, radii


def rotation(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Float:
    """Returns the (3, 3) matrix Rz(z) Ry(y) Rx(x): rotations about the fixed x, then y, then z axis,
    radians.
    """
    cx, sx, cy, sy, cz, sz = *_cos_sin(x), *_cos_sin(y), *_cos_sin(z)
    return np.array(
        [
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ]
    )


def _cos_sin(angle: float) -> tuple[float, float]:
    """Returns the cosine and sine of an angle in radians."""
    return math.cos(angle), math.sin(angle)


_PREDICTED_FRACTION = 0.8
"""Fraction of a frame's motion that is predicted for the next frame. Predicting all of it would overshoot at
stops."""
_MAX_STEP = 0.1
"""Maximum predicted motion per frame in metres: 3 m/s at 30 frames per second."""
_MAX_TURN = 0.25
"""Maximum predicted rotation of a joint per frame in radians: 7.5 rad/s at 30 frames per second."""


def predict_next(previous: Posture, current: Posture) -> Posture:
    """Returns the posture predicted for the next frame.

    The motion continues, slightly slower and with limited speed.
    """
    predicted = current.copy()
    step = _PREDICTED_FRACTION * (current.position - previous.position)
    predicted.position += step * min(1.0, _MAX_STEP / max(1e-9, math.hypot(*step)))
    extrapolate(predicted.rotations, previous.rotations, _PREDICTED_FRACTION, _MAX_TURN)
    return predicted


_USUAL_LEAN_SINE = 0.15
"""Sine of a trunk's usual backward lean. Only a larger lean is penalised."""
_LYING_SINE = 0.4
"""If the sine of a trunk's elevation is below this value, the person is lying, and no lean is computed."""


@njit(cache=True, nogil=True)
def chest_axes(rotations):
    """Returns two unit vectors, world frame: towards the chest's left, and up along it.

    Args:
        rotations: (13, 3, 3) a posture's rotations, parent_from_frame.
    """
    turn = product(rotations[PELVIS], rotations[CHEST])
    return (turn[0, 0], turn[1, 0], turn[2, 0]), (turn[0, 1], turn[1, 1], turn[2, 1])


@njit(cache=True, nogil=True)
def chest_axes_about(rotations):
    """Returns the chest axes of the flipped posture (:func:`appearance.flip_posture`) without creating it.

    The flip mirrors left and right and adds half a turn about the pelvis' upright axis. So the chest is
    mirrored from front to back in the pelvis' frame.
    """
    mirrored = rotations[CHEST].copy()
    for a in range(3):
        mirrored[2, a] = -mirrored[2, a]
    turn = product(rotations[PELVIS], mirrored)
    return (-turn[0, 0], -turn[1, 0], -turn[2, 0]), (turn[0, 1], turn[1, 1], turn[2, 1])


@njit(cache=True, nogil=True)
def facing_direction(left):
    """Returns the unit (x, z) direction that a chest faces, computed from the line between its shoulders.

    It is also valid for a person who bends over.
    """
    length = np.sqrt(left[0] * left[0] + left[2] * left[2]) + 1e-9
    return -left[2] / length, left[0] / length


@njit(cache=True, nogil=True)
def backward_lean(left, up):
    """Returns the backward lean of a chest: the sine of its angle beyond the usual lean.

    A backward lean is implausible, because people usually bend forward.
    """
    if up[1] < _LYING_SINE:
        return 0.0
    x, z = facing_direction(left)
    return max(0.0, -(up[0] * x + up[2] * z) - _USUAL_LEAN_SINE)
