"""Possession: a tracked body takes hold of a deformation graph (KinÊtre, "Constraints").

Each bone is a cylinder with samples; a sample that lies near a node, and faces the same way, becomes a point
constraint. The samples then move with the bones, and the solver moves the graph with the samples.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numba import njit

from enliven.arrays import Bool, Float, Int, Int32
from enliven.body import PARENTS, J, parts_named
from enliven.deformation.bones import bone_rotations, bone_samples, filled
from enliven.deformation.graph import DeformationGraph
from enliven.deformation.weights import insert
from enliven.errors import InputError
from enliven.settings import setting

_PARENT = np.array(PARENTS)


@dataclass(frozen=True)
class AttachmentSettings:
    """How a body takes hold of a mesh."""

    radius: float = setting(0.04, "Radius of the cylinder around each bone.", unit="m", low=0.0, high=0.5)
    along: int = setting(4, "Samples along each bone.", low=1, high=64)
    around: int = setting(4, "Samples around each bone.", low=1, high=64)
    reach: float = setting(0.10, "How near a node must be to be taken hold of.", unit="m", low=0.0, high=2.0)
    normal_angle: float = setting(
        math.pi / 2, "How far two normals may be apart.", unit="rad", low=0.0, high=math.pi
    )
    joints: bool = setting(True, "Whether the joints take hold too, besides the bones.")


@dataclass(frozen=True)
class Attachment:
    """Point constraints that a body drives; L may be 0 where nothing was in reach.

    Attributes:
        points: (L, 3) metres, p_l, in the mesh's rest space.
        node_indices: (L, 4) int32 the nodes that move each point.
        node_weights: (L, 4) how much; they sum to one, 0 where fewer than four are valid.
        bone: (L,) the child joint of the bone that each point sits on (:class:`enliven.body.Joint`).
        along: (L,) where along the bone: 0 is the parent joint itself, 1 the child joint itself.
        radial: (L, 3) metres from the bone's axis to the point, in the world, when it took hold.
        rest: (20, 3) metres, the joints when they took hold.
    """

    points: Float
    node_indices: Int32
    node_weights: Float
    bone: Int
    along: Float
    radial: Float
    rest: Float = field(repr=False)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def nodes(self) -> tuple[Int, Float]:
        """(K,) the nodes held, and (K,) how strongly, in (0, 1]: for the viewer's highlights."""
        if not len(self):
            return np.empty(0, np.int64), np.empty(0)
        total = np.bincount(self.node_indices.reshape(-1), self.node_weights.reshape(-1))
        held = np.flatnonzero(total > 0)
        return held, total[held] / total.max()

    def targets(self, joints: Float) -> Float:
        """(L, 3) metres where the points should be now, q_l; NaN where a joint they need is not finite.

        A point keeps its fraction along the bone, however long the bone is now, and its distance from the
        bone's axis.

        Args:
            joints: (20, 3) metres, world frame.
        """
        joints = checked_joints(joints)
        turns, _ = bone_rotations(self.rest, joints)
        ends = filled(joints, filled(self.rest, self.rest))
        out = np.empty((len(self), 3))
        _place(ends, turns, self.bone, self.along, self.radial, out)
        finite = np.asarray(np.isfinite(joints).all(1))
        out[~self._of_ends(finite.astype(np.float64)).astype(bool)] = np.nan
        return out

    def _of_ends(self, values: Float) -> Float:
        """(L,) the smaller of ``values`` (20,) at a bone's ends; at a joint itself, that joint's own."""
        child, parent = values[self.bone], values[_PARENT[self.bone]]
        inner = np.minimum(child, parent)
        return np.where(self.along == 1.0, child, np.where(self.along == 0.0, parent, inner))

    def target_weights(self, confidence: Float) -> Float:
        """(L,) in [0, 1]: 0 where a joint of the bone is lost, rising smoothly with its confidence.

        Args:
            confidence: (20,) in [0, 1]; NaN counts as 0.
        """
        sure = np.clip(np.nan_to_num(np.asarray(confidence, np.float64), nan=0.0), 0.0, 1.0)
        if sure.shape != (J,):
            raise InputError(f"the confidence is {sure.shape}, expected ({J},)", where="attachment")
        weaker = self._of_ends(sure)
        return np.asarray(weaker * weaker * (3 - 2 * weaker))


def checked_joints(joints: Float) -> Float:
    """The joints as (20, 3) float64, or an InputError."""
    joints = np.ascontiguousarray(joints, np.float64)
    if joints.shape != (J, 3):
        raise InputError(f"the joints are {joints.shape}, expected ({J}, 3)", where="attachment")
    return joints


def attach(
    graph: DeformationGraph,
    joints: Float,
    confidence: Float,
    parts: str | Iterable[str] = "all",
    settings: AttachmentSettings | None = None,
    deformed: tuple[Float, Float] | None = None,
) -> Attachment:
    """Take hold of the graph where the body is now; also the preview of what would be held.

    Args:
        graph: of the mesh, in the same world frame.
        joints: (20, 3) metres; a bone with a joint that is not finite does not take hold.
        confidence: (20,); a bone with a joint of confidence 0 does not take hold.
        parts: names of :data:`enliven.body.PARTS`; a bone belongs to its child joint.
        settings: radius, samples, reach and angle.
        deformed: the (N, 3, 3) linear parts and (N, 3) positions of the nodes now, where the mesh is not at
            rest (to take hold again, or with a second body).

    Raises:
        InputError: for an unknown part or arrays of the wrong shape.
    """
    settings = settings or AttachmentSettings()
    joints = checked_joints(joints)
    chosen = parts_named(parts)
    sure = np.nan_to_num(np.asarray(confidence, np.float64), nan=0.0) > 0
    if sure.shape != (J,):
        raise InputError(f"the confidence is {sure.shape}, expected ({J},)", where="attachment")
    usable = sure & np.isfinite(joints).all(1)
    samples = _samples(joints, usable, np.isin(np.arange(J), list(chosen)), settings)
    points, normals, bone, along, radial = samples
    node_points, node_normals = _nodes_now(graph, deformed)
    indices, weights = _hold(
        points, normals, node_points, node_normals, settings.reach, math.cos(settings.normal_angle)
    )
    held = weights[:, 0] > 0
    indices, weights = indices[held], weights[held]
    if deformed is not None:
        points = _to_rest(points[held], indices, weights, graph.positions, *deformed)
    else:
        points = points[held]
    return Attachment(points, indices, weights, bone[held], along[held], radial[held], joints)


def _samples(
    joints: Float, usable: Bool, chosen: Bool, settings: AttachmentSettings
) -> tuple[Float, Float, Int, Float, Float]:
    """Position, normal (zero at a joint), bone, fraction and radial offset of each sample."""
    points, normals = bone_samples(joints, settings.radius, settings.along, settings.around)
    count = points.shape[1]
    bones = np.flatnonzero(usable[1:] & usable[_PARENT[1:]] & chosen[1:])
    fraction = np.repeat((np.arange(settings.along) + 0.5) / settings.along, settings.around)
    where, facing = [points[bones].reshape(-1, 3)], [normals[bones].reshape(-1, 3)]
    bone, along = [np.repeat(bones + 1, count)], [np.tile(fraction, len(bones))]
    if settings.joints:
        own = np.flatnonzero(usable & chosen)
        # The root ends no bone; it is the start of the first one.
        first = own == 0
        own = own[~first | usable[1]]
        first = own == 0
        where.append(joints[own])
        facing.append(np.zeros((len(own), 3)))
        bone.append(np.where(first, 1, own))
        along.append(np.where(first, 0.0, 1.0))
    position, normal = np.concatenate(where), np.concatenate(facing)
    on_joint = (normal == 0).all(1, keepdims=True)
    radial = np.where(on_joint, 0.0, normal * settings.radius)
    return position, normal, np.concatenate(bone), np.concatenate(along), radial


def _nodes_now(graph: DeformationGraph, deformed: tuple[Float, Float] | None) -> tuple[Float, Float]:
    """(N, 3) positions and (N, 3) unit normals of the nodes as they stand."""
    if deformed is None:
        return graph.positions, graph.normals
    linear, positions = deformed
    normals = np.einsum("nab,nb->na", linear, graph.normals)
    return positions, normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def _to_rest(
    points: Float, indices: Int32, weights: Float, pivots: Float, linear: Float, positions: Float
) -> Float:
    """(L, 3) the points carried back to the rest space, blended over their nodes."""
    back = np.linalg.pinv(linear)[indices]
    local = np.einsum("lkab,lkb->lka", back, points[:, None] - positions[indices]) + pivots[indices]
    return np.asarray((local * weights[..., None]).sum(1))


@njit(cache=True, nogil=True)
def _hold(points, normals, nodes, node_normals, reach, cosine):  # type: ignore[no-untyped-def]
    """Kernel: the four nearest valid nodes of each point, and weights 1 - d / reach that sum to one."""
    count = points.shape[0]
    indices = np.zeros((count, 4), np.int32)
    weights = np.zeros((count, 4))
    near = np.empty(4)
    who = np.empty(4, np.int64)
    for i in range(count):
        found = 0
        n = normals[i]
        free = n[0] == 0.0 and n[1] == 0.0 and n[2] == 0.0
        for j in range(nodes.shape[0]):
            dx, dy, dz = points[i, 0] - nodes[j, 0], points[i, 1] - nodes[j, 1], points[i, 2] - nodes[j, 2]
            length = np.sqrt(dx * dx + dy * dy + dz * dz)
            if not length < reach:
                continue
            facing = n[0] * node_normals[j, 0] + n[1] * node_normals[j, 1] + n[2] * node_normals[j, 2]
            if free or facing > cosine:
                found = insert(near, who, found, length, j)
        total = 0.0
        for m in range(found):
            total += 1.0 - near[m] / reach
        for m in range(found):
            indices[i, m] = who[m]
            weights[i, m] = (1.0 - near[m] / reach) / total
    return indices, weights


@njit(cache=True, nogil=True)
def _place(joints, turns, bone, along, radial, out):  # type: ignore[no-untyped-def]
    """Kernel of :meth:`Attachment.targets`."""
    for i in range(bone.shape[0]):
        child = bone[i]
        parent = _PARENT[child]
        turn = turns[child - 1]
        for a in range(3):
            out[i, a] = joints[parent, a] + along[i] * (joints[child, a] - joints[parent, a])
            for c in range(3):
                out[i, a] += turn[a, c] * radial[i, c]
