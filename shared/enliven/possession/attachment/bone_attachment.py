"""Attachment: binds a tracked body to a deformation graph (KinÊtre, section "Constraints").

Each bone is a cylinder with sample points. A sample becomes a point constraint if it is near a node and its
normal is similar to the node's. These samples then move with the bones, and the solver deforms the graph to
follow them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Bool, Float, Int, Int32
from enliven.deformation.graph.graph import DeformationGraph
from enliven.errors import InputError
from enliven.kernels import njit
from enliven.person import PARENTS, J, Joint, parse_parts
from enliven.possession.actor_settings import AttachmentSettings
from enliven.possession.attachment.bone_cylinders import bone_rotations, bone_samples, fill_joints
from enliven.possession.attachment.nearest_nodes import nearest_facing, to_rest_space

_PARENT_JOINTS = np.array(PARENTS)
_LIMB_OF_BONE = np.array([0, 0, 0, 0, *[1] * 4, *[2] * 4, *[3] * 4, *[4] * 4])
"""(20,) limb number of each bone, indexed by its child joint: 0 trunk, 1 and 2 arms, 3 and 4 legs."""
_ARM_NUMBERS = (1, 2)
"""The numbers of the arms in ``_LIMB_OF_BONE``."""
_PELVIS_CHILDREN = (int(Joint.SPINE), int(Joint.HIP_LEFT), int(Joint.HIP_RIGHT))
"""Child joints of the bones that begin at the pelvis."""


@dataclass(frozen=True)
class ReachGrowth:
    """Increases the reach of each limb until enough of its bones attach. It is used for a body that does not
    fit the mesh.

    If the performer attaches with the whole body, the reach of the arms is limited to the reach that the
    whole body needs. Otherwise the arms would attach to the sides of a mesh without arms.

    Attributes:
        enough: fraction of a limb's bones that must attach before its reach stops growing.
        farthest: the longest reach that is tried, metres.
    """

    enough: float
    farthest: float

    def limb_reaches(self, reach: float, bone: Int, nearest: Float) -> Float:
        """Returns the reach (L,) of each sample, metres. It is ``reach``, or a longer reach if too few bones
        would attach.

        Args:
            bone: (L,) the bone of each sample.
            nearest: (L,) distance from each sample to the nearest node, metres; infinite if there is none.
        """
        nearest_per_bone = np.full(J, np.inf)
        np.minimum.at(nearest_per_bone, bone, nearest)
        has_all_bones = len(np.unique(bone)) >= J - 1
        reaches = np.full(len(bone), self._extend_reach(reach, nearest_per_bone[np.unique(bone)]))
        for limb in np.unique(_LIMB_OF_BONE[bone]):
            if not (has_all_bones and limb in _ARM_NUMBERS):
                on_limb = _LIMB_OF_BONE[bone] == limb
                reaches[on_limb] = self._extend_reach(reach, nearest_per_bone[np.unique(bone[on_limb])])
        return reaches

    def _extend_reach(self, reach: float, first: Float) -> float:
        """Returns the reach at which enough bones attach, metres. ``first`` (B,) are the distances from the
        bones to their nearest nodes.
        """
        while np.count_nonzero(first < reach) < self.enough * len(first) and reach < self.farthest:
            reach = min(1.5 * reach + 0.01, self.farthest)
        return reach


@dataclass(frozen=True)
class Attachment:
    """L point constraints. Their targets follow a body. L is 0 if no node was within reach.

    Attributes:
        points: (L, 3) the constrained points p_l in the mesh's rest space, metres.
        node_indices: (L, 4) int32 the nodes that move each point.
        node_weights: (L, 4) weights of these nodes. They sum to one; unused entries are 0.
        bone: (L,) the bone of each point, given by its child joint (:class:`enliven.person.body.Joint`).
        along: (L,) position along the bone: 0 is the parent joint, 1 is the child joint.
        radial: (L, 3) offset from the bone's axis to the point, in the world, at the time of attaching,
            metres.
        rest: (20, 3) the joints at the time of attaching, metres.
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
        """The nodes (K,) that the points are attached to, and the strength (K,) of each, in (0, 1], for the
        viewer's highlights."""
        if not len(self):
            return np.empty(0, np.int64), np.empty(0)
        total = np.bincount(self.node_indices.reshape(-1), self.node_weights.reshape(-1))
        held_nodes = np.flatnonzero(total > 0)
        return held_nodes, total[held_nodes] / total.max()

    def select_points(self, mask: Bool) -> Attachment:
        """Returns the attachment restricted to the points in a mask (L,)."""
        return Attachment(
            self.points[mask],
            self.node_indices[mask],
            self.node_weights[mask],
            self.bone[mask],
            self.along[mask],
            self.radial[mask],
            self.rest,
        )

    def targets(self, joints: Float, turns: Float | None = None) -> Float:
        """Returns the current target positions q_l (L, 3) of the points, in metres. A target is NaN if a
        joint of its bone is not finite.

        A point keeps its fraction along the bone, even if the bone's length changes, and its distance from
        the bone's axis.

        Args:
            joints: (20, 3) metres, world frame.
            turns: (19, 3, 3) rotation of each bone since the body attached. None computes it from the joints.
                It is needed if hips or shoulders are missing, because then the joints do not determine the
                trunk's twist about its axis.
        """
        joints = check_joints(joints)
        turns = bone_rotations(self.rest, joints)[0] if turns is None else np.ascontiguousarray(turns)
        finite_joints = fill_joints(joints, fill_joints(self.rest, self.rest))
        target_positions = np.empty((len(self), 3))
        _write_targets(finite_joints, turns, self.bone, self.along, self.radial, target_positions)
        finite = np.asarray(np.isfinite(joints).all(1))
        target_positions[~self._choose_smaller_of_ends(finite.astype(np.float64)).astype(bool)] = np.nan
        return target_positions

    def _choose_smaller_of_ends(self, values: Float) -> Float:
        """Returns the smaller of ``values`` (20,) at the two ends of each bone, (L,). A point on a joint uses
        that joint's value.
        """
        child, parent = values[self.bone], values[_PARENT_JOINTS[self.bone]]
        inner = np.minimum(child, parent)
        return np.where(self.along == 1.0, child, np.where(self.along == 0.0, parent, inner))

    def target_weights(self, confidence: Float) -> Float:
        """Returns weights (L,) in [0, 1]. A weight is 0 if a joint of the bone is lost, and rises smoothly
        with the joint's confidence.

        Args:
            confidence: (20,) in [0, 1]; NaN counts as 0.
        """
        certainty = np.clip(np.nan_to_num(np.asarray(confidence, np.float64), nan=0.0), 0.0, 1.0)
        if certainty.shape != (J,):
            raise InputError(f"the confidence is {certainty.shape}, expected ({J},)", where="attachment")
        weaker = self._choose_smaller_of_ends(certainty)
        return np.asarray(weaker * weaker * (3 - 2 * weaker))


def check_joints(joints: Float) -> Float:
    """Returns the joints as (20, 3) float64, or raises InputError."""
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
    grow: ReachGrowth | None = None,
) -> Attachment:
    """Attaches the body in its current pose to the graph. The result also serves as a preview of the nodes
    that the body would attach to.

    Args:
        graph: deformation graph of the mesh, in the same world frame.
        joints: (20, 3) metres. A bone with a joint that is not finite does not attach.
        confidence: (20,) the confidence of the joints. A bone with a joint of confidence 0 does not attach.
        parts: names from :data:`enliven.person.body.PARTS`. A bone belongs to the part of its child joint.
        settings: radius, samples, reach and angle.
        deformed: current (N, 3, 3) linear parts and (N, 3) positions of the nodes, if an attached body
            already deforms the mesh.
        grow: extends the reach beyond the settings if too few bones reach a node.

    Raises:
        InputError: if a part is unknown or an array has the wrong shape.
    """
    settings, grow = settings or AttachmentSettings(), grow or ReachGrowth(0.0, 0.0)
    joints = check_joints(joints)
    chosen = np.isin(np.arange(J), list(parse_parts(parts)))
    is_tracked = np.nan_to_num(np.asarray(confidence, np.float64), nan=0.0) > 0
    if is_tracked.shape != (J,):
        raise InputError(f"the confidence is {is_tracked.shape}, expected ({J},)", where="attachment")
    usable = is_tracked & np.isfinite(joints).all(1)
    points, normals, bone, along, radial, starts = _find_usable_samples(joints, usable, chosen, settings)
    node_points, node_normals = _deform_nodes(graph, deformed)
    farthest = max(settings.reach, grow.farthest)
    cosine = math.cos(settings.normal_angle)
    indices, lengths = nearest_facing(points, normals, starts, node_points, node_normals, farthest, cosine)
    reach = grow.limb_reaches(settings.reach, bone, lengths[:, 0])
    is_attached = lengths[:, 0] < reach
    weights = (
        np.maximum(1.0 - lengths[is_attached] / reach[is_attached, None], 0.0)
        if is_attached.any()
        else np.empty((0, 4))
    )
    weights /= weights.sum(1, keepdims=True)
    indices = np.where(weights > 0, indices[is_attached], 0).astype(np.int32)
    points = points[is_attached]
    if deformed is not None:
        linear, positions = (np.ascontiguousarray(a, np.float64) for a in deformed)
        points = to_rest_space(points, indices, weights, graph.positions, linear, positions)
    return Attachment(
        points, indices, weights, bone[is_attached], along[is_attached], radial[is_attached], joints
    )


def _find_usable_samples(
    joints: Float, usable: Bool, chosen: Bool, settings: AttachmentSettings
) -> tuple[Float, Float, Int, Float, Float, Int]:
    """Returns the samples of all usable bones and joints, grouped by bone and by joint.

    Returns:
        For each sample: position, normal (zero at a joint), bone, fraction along the bone, and radial offset.
        For each group: the index at which it begins.
    """
    points, normals = bone_samples(joints, settings.radius, settings.along, settings.around)
    count = points.shape[1]
    bones = np.flatnonzero(usable[1:] & usable[_PARENT_JOINTS[1:]] & chosen[1:])
    fraction = np.repeat((np.arange(settings.along) + 0.5) / settings.along, settings.around)
    positions, facing = [points[bones].reshape(-1, 3)], [normals[bones].reshape(-1, 3)]
    starts = count * np.arange(len(bones) + 1)
    bone, along = [np.repeat(bones + 1, count)], [np.tile(fraction, len(bones))]
    if chosen[0] and not chosen[[*_PELVIS_CHILDREN]].any() and usable[:2].all():
        # The root joint is not the child of any bone. If only the hip is chosen, use the samples of the lower
        # half of the spine. Then a rotation of the hip rotates the attached part.
        pelvis = fraction < 0.5
        positions.append(points[0][pelvis])
        facing.append(normals[0][pelvis])
        bone.append(np.ones(int(pelvis.sum()), int))
        along.append(fraction[pelvis])
        starts = np.append(starts, starts[-1] + int(pelvis.sum()))
    if settings.joints:
        bone_indices = np.flatnonzero(usable & chosen)
        # The root joint is the start of the first bone.
        first = bone_indices == 0
        bone_indices = bone_indices[~first | usable[1]]
        first = bone_indices == 0
        positions.append(joints[bone_indices])
        facing.append(np.zeros((len(bone_indices), 3)))
        bone.append(np.where(first, 1, bone_indices))
        along.append(np.where(first, 0.0, 1.0))
        starts = np.concatenate([starts, starts[-1] + 1 + np.arange(len(bone_indices))])
    position, normal = np.concatenate(positions), np.concatenate(facing)
    on_joint = (normal == 0).all(1, keepdims=True)
    radial = np.where(on_joint, 0.0, normal * settings.radius)
    return position, normal, np.concatenate(bone), np.concatenate(along), radial, starts


def _deform_nodes(graph: DeformationGraph, deformed: tuple[Float, Float] | None) -> tuple[Float, Float]:
    """Returns (N, 3) positions and (N, 3) unit normals of the nodes in the current deformation."""
    if deformed is None:
        return graph.positions, graph.normals
    linear, positions = deformed
    normals = np.einsum("nab,nb->na", linear, graph.normals)
    return positions, normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


@njit(cache=True, nogil=True)
def _write_targets(joints, turns, bone, along, radial, out):
    """Writes the targets (L, 3) to ``out`` (kernel of :meth:`Attachment.targets`)."""
    for i in range(bone.shape[0]):
        child = bone[i]
        parent = _PARENT_JOINTS[child]
        turn = turns[child - 1]
        for a in range(3):
            out[i, a] = joints[parent, a] + along[i] * (joints[child, a] - joints[parent, a])
            for c in range(3):
                out[i, a] += turn[a, c] * radial[i, c]
