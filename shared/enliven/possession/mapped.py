"""Limb drives limb: a performer's joints as joints of the skeleton that was found in a mesh."""

from __future__ import annotations

import numpy as np

from enliven import rotation
from enliven.arrays import Float, Float32
from enliven.person import PARENTS, Body, J, Joint
from enliven.possession.bone_cylinders import bone_rotations, filled_joints
from enliven.possession.likeness import BodyInMesh
from enliven.possession.placement import facing, turn_about_y
from enliven.possession.standing import standing_figure
from enliven.rotation import unit

_HIP = Joint.HIP_CENTER
_AS_IN_THE_MESH = frozenset(
    joint for joint in Joint if joint.name.split("_")[0] in ("ELBOW", "WRIST", "KNEE", "ANKLE")
)
"""The ends of bones that point as the performer's do: of arms and legs. A trunk, a hand or a foot of a mesh
may be built otherwise: it turns by as much as the performer's."""
_SWING = 1.5 * np.pi / 2
"""The steepest slope of the cubic by which a mesh comes to a pose, along an arc for its chord."""


class Mapped:
    """Limb drives limb: each bone of the mesh's own skeleton turns as the performer's bone has turned.

    Joints are chained down the mesh's skeleton: j = parent + Q R Q^T (rest bone), with R the rotation of the
    performer's bone since it was as the mesh's bone is at rest, and Q the rotation from their facing to the
    mesh's front. A human-like mesh comes to its performer's pose from its own; others are held as they
    are. The hip moves as theirs does, scaled by the ratio of the leg lengths, if there are legs.

    Args:
        likeness: the mesh's skeleton.
        body: the performer as they take hold.
        scale: metres of the performer for one metre of the rest space.
        travel: share of their travel over the floor that the mesh makes too.
        seconds: how long the mesh takes to come to the performer's pose.
        pace: metres of the performer a second, the fastest that it does so.
        inside: whether the mesh is where the performer is, so that it goes over the floor exactly as they do.
    """

    fits = True

    def __init__(
        self,
        likeness: BodyInMesh,
        body: Body,
        scale: float,
        travel: float = 1.0,
        seconds: float = 0.0,
        pace: float = np.inf,
        inside: bool = False,
    ) -> None:
        self.likeness, self.scale, self.body = likeness, scale, body.id
        self._last = now = filled_joints(body.joints, body.joints)
        yaw = facing(body)
        self._turn = turn_about_y(likeness.yaw - yaw)
        self._rest = _as_the_mesh(likeness, now, yaw, self._turn) if likeness.human else now
        self._home = self._rest[_HIP].copy()
        measure = scale
        if np.isfinite(likeness.leg):
            of_legs = BodyInMesh(self._rest, 0.0).leg / likeness.leg
            measure = float(np.clip(of_legs, scale / 5, 5 * scale))
        over_floor = travel / (scale if inside else measure)
        self._steps = np.array([over_floor, 1.0 / measure, over_floor])
        self._share, self._start_ns, self._seconds = 1.0, -1, seconds
        if likeness.human and seconds > 0:
            farthest = float(np.linalg.norm(self(body.joints) - likeness.joints, axis=1).max())
            self._seconds = max(seconds, _SWING * farthest * scale / pace)
            self._share = 0.0

    @property
    def at_rest(self) -> Float | None:
        """(20, 3) metres where the bones take hold of the mesh at rest; None: where the joints are now."""
        return self.likeness.joints if self.likeness.human else None

    def goes_on(self, other: Mapped) -> None:
        """Is as far on its way to the performer's pose as another is that has met them before."""
        self._share, self._start_ns, self._seconds = other._share, other._start_ns, other._seconds

    def at(self, time_ns: int) -> None:
        """Brings the mesh nearer to the performer's pose, until it is in it."""
        if self._share < 1.0:
            self._start_ns = time_ns if self._start_ns < 0 else self._start_ns
            part = float(np.clip((time_ns - self._start_ns) * 1e-9 / self._seconds, 0.0, 1.0))
            self._share = part * part * (3.0 - 2.0 * part)

    def __call__(self, joints: Float) -> Float:
        """(20, 3) joints of the mesh's skeleton, from (20, 3) in the world; NaN where it has none."""
        now = filled_joints(joints, self._last)
        self._last = now
        turns = self._turn @ bone_rotations(self._rest, now)[0] @ self._turn.T
        if self._share < 1.0:
            part = rotation.slerp(rotation.IDENTITY, rotation.from_matrix(turns), np.array(self._share))
            turns = rotation.to_matrix(part)
        own = self.likeness.joints
        way = (now[_HIP] - self._home) * self._steps
        out = np.empty((J, 3))
        out[_HIP] = own[_HIP] + self._share * (self._turn @ way)
        for child in range(1, J):
            parent = PARENTS[child]
            out[child] = out[parent] + turns[child - 1] @ (own[child] - own[parent])
        return out

    def surface(self, points: Float | Float32, normals: Float | Float32) -> tuple[Float, Float]:
        """Returns two empty arrays (0, 3): a person's surface does not lie on a mesh of another shape."""
        return np.empty((0, 3)), np.empty((0, 3))

    def handed_over(self, body: Body) -> None:
        """Continues with another body from where the last one was."""
        self.body = body.id
        step = body.joints[_HIP] - self._last[_HIP]
        if np.isfinite(step).all():
            self._home = self._home + step
            self._last = self._last + step


def _as_the_mesh(likeness: BodyInMesh, now: Float, yaw: float, turn: Float) -> Float:
    """(20, 3) metres: the performer upright on their floor, with limbs that point as the mesh's at rest.

    Args:
        now: (20, 3) metres, the performer.
        yaw: radians about +Y that they face.
        turn: (3, 3) from their facing to the mesh's front.
    """
    figure = standing_figure() @ turn_about_y(yaw).T
    mesh = likeness.joints @ turn
    made = np.empty((J, 3))
    made[_HIP] = now[_HIP]
    for joint in list(Joint)[1:]:
        parent = PARENTS[joint]
        way = figure[joint] - figure[parent]
        if joint in _AS_IN_THE_MESH:
            way = mesh[joint] - mesh[parent]
        elif Joint(parent) in _AS_IN_THE_MESH:
            before = PARENTS[parent]
            way = rotation.rotate(
                rotation.swing(unit(figure[parent] - figure[before]), unit(mesh[parent] - mesh[before])),
                way,
            )
        made[joint] = made[parent] + float(np.linalg.norm(now[joint] - now[parent])) * unit(way)
    made[:, 1] += now[:, 1].min() - made[:, 1].min()
    return made
