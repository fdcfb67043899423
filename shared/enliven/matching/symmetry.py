"""Finds equal limbs of a skeleton, so that the motion of one limb can be copied to all (future work in
AniMesh, section 8).

A *limb* is a joint with all its descendants, relative to its parent joint. Two limbs of one joint are equal
if a rotation or reflection maps the joints of one limb to the joints of the other. The axis of the rotation,
or the plane of the reflection, goes through the parent joint. Examples are tentacles around a squid's head,
and the left and right limbs of any character. Hand-made skeletons are only approximately symmetric, so
positions may differ by a fraction of the limb's reach.

The axis of several limbs is the normal of the plane through their centres (three centres at equal distance
from the joint define one circle). For two limbs, the plane is half-way between their centres.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Literal

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton
from enliven.matching.limb_shapes import LimbShapes
from enliven.rotation import from_rotation_vector, to_matrix
from enliven.settings import parameter

_MIN_LIMB_FRACTION = 0.02
"""Minimum length of a limb, as a fraction of the longest limb. Shorter limbs are ignored, because they are
only ends of bones."""
_MIN_MAPPED_FRACTION = 0.75
"""Minimum fraction of similar limbs that a rotation must map to one another. Smaller groups are coincidences.
For example, about three of a spider's eight legs are always rotated copies of one another."""


@dataclass(frozen=True)
class SymmetrySettings:
    """Settings for the comparison of limbs."""

    tolerance: float = parameter(
        0.08,
        "Maximum root mean square distance between joints of equal limbs, as a fraction of the limb's "
        "reach. No joint may exceed twice this.",
        low=0.0,
        high=0.5,
    )


@dataclass(frozen=True, eq=False)
class EqualLimb:
    """One of a group of equal limbs.

    Attributes:
        joints: the limb's joints, in the same order as in the group's other limbs. The first joint's parent
            is the group's joint.
        linear: (3, 3) map from the group's first limb to this limb, about the group's joint.
        error: remaining root mean square distance of the joints, as a fraction of the limb's reach.
    """

    joints: tuple[int, ...]
    linear: Float
    error: float


@dataclass(frozen=True, eq=False)
class EqualLimbs:
    """A group of equal limbs with the same parent joint.

    Attributes:
        kind: "rotation" for limbs that are rotated about the axis, or "mirror" for two limbs on both sides of
            a plane.
        joint: their common parent joint.
        axis: (3,) unit vector along the axis, or normal to the plane. Axis and plane go through the joint.
        limbs: two or more limbs, sorted by their angle about the axis.
    """

    kind: Literal["rotation", "mirror"]
    joint: int
    axis: Float
    limbs: tuple[EqualLimb, ...]

    def limb_of(self, joint: int) -> int:
        """Returns the number of the limb that a joint belongs to, or -1."""
        return next((i for i, limb in enumerate(self.limbs) if joint in limb.joints), -1)

    def get_map(self, start: int, end: int) -> Float:
        """Returns the map (3, 3) from limb ``start`` to limb ``end``."""
        return np.asarray(self.limbs[end].linear @ self.limbs[start].linear.T)

    def joint_map(self, start: int, end: int) -> dict[int, int]:
        """Maps the joints of limb ``start`` to those of limb ``end``. The group's joint maps to itself."""
        pairs = zip(self.limbs[start].joints, self.limbs[end].joints, strict=True)
        return {self.joint: self.joint, **dict(pairs)}


def find_equal_limbs(skeleton: Skeleton, settings: SymmetrySettings | None = None) -> tuple[EqualLimbs, ...]:
    """Returns all groups of equal limbs, the largest groups first. Pairs about the body's main plane of
    symmetry come before other pairs.

    Three or more limbs that are equal under rotation form one group. Two such limbs form a group if they have
    no mirror plane. A limb may belong to two groups, one by rotation and one by reflection, such as the legs
    of a table.
    """
    settings = settings or SymmetrySettings()
    body = LimbShapes(skeleton)
    similar = list(body.find_similar_limbs(settings.tolerance, _MIN_LIMB_FRACTION))
    rotated = [
        group
        for joint, similar_children in similar
        for group in _rotation_group(body, joint, similar_children, settings)
    ]
    mirrored = [
        group
        for joint, similar_children in similar
        for group in _find_mirrored_pairs(body, joint, similar_children, settings)
    ]
    paired = {frozenset(limb.joints[0] for limb in group.limbs) for group in mirrored}
    rotated = [
        candidate
        for candidate in rotated
        if len(candidate.limbs) > 2 or frozenset(limb.joints[0] for limb in candidate.limbs) not in paired
    ]
    return tuple(
        sorted([*_select_pairs_by_plane(mirrored, body), *rotated], key=lambda group: -len(group.limbs))
    )


def _rotation_group(
    body: LimbShapes, joint: int, similar: list[int], settings: SymmetrySettings
) -> list[EqualLimbs]:
    """Returns the largest group of limbs that are equal under rotation, if it has most of the similar
    limbs."""
    largest: EqualLimbs | None = None
    for axis in _candidate_axes(body, joint, similar):
        group = _limbs_equal_around(body, joint, similar, axis, settings)
        if group is not None and (largest is None or len(group.limbs) > len(largest.limbs)):
            largest = group
        if largest is not None and len(largest.limbs) == len(similar):
            break
    return (
        [largest] if largest is not None and len(largest.limbs) >= _MIN_MAPPED_FRACTION * len(similar) else []
    )


def _candidate_axes(body: LimbShapes, joint: int, limbs: list[int]) -> list[Float]:
    """Returns candidate axes of rotation, computed from all limbs and from triples, or from a pair."""
    middles = body.middle[limbs] - body.at[joint]
    if len(limbs) == 2:
        return [axis for axis in [_unit_vector(middles.sum(0))] if axis is not None]
    centred = middles - middles.mean(0)
    axes = [np.linalg.eigh(centred.T @ centred)[1][:, 0]]
    # A limited number of triples is enough, because any circle of three or more limbs contains three limbs
    # that are consecutive in the list.
    for a, b, c in itertools.islice(itertools.combinations(middles, 3), 200):
        axis = _unit_vector(np.cross(b - a, c - a))
        if axis is not None:
            axes.append(axis)
    return axes


def _limbs_equal_around(
    body: LimbShapes, joint: int, limbs: list[int], axis: Float, settings: SymmetrySettings
) -> EqualLimbs | None:
    """Returns the largest group of limbs that are equal under rotation about an axis, or None."""
    if axis[int(np.argmax(np.abs(axis)))] < 0.0:
        axis = -axis
    best: list[EqualLimb] = []
    for first in limbs[: max(1, len(limbs) - 2)]:
        matches = []
        for other in limbs:
            angle = _angle_about(
                body.middle[first] - body.at[joint], body.middle[other] - body.at[joint], axis
            )
            linear = to_matrix(from_rotation_vector(angle * axis))
            matched = body.match(joint, first, other, linear, settings.tolerance)
            if matched is not None:
                matches.append((angle % (2 * np.pi - 1e-9), matched, linear))
        if len(matches) > len(best):
            order = [pair[0] for pair in matches[0][1].pairs]
            best = [
                EqualLimb(tuple(dict(matched.pairs)[j] for j in order), linear, matched.error)
                for _, matched, linear in sorted(matches, key=lambda entry: entry[0])
            ]
        if len(best) == len(limbs):
            break
    return EqualLimbs("rotation", joint, axis, tuple(best)) if len(best) > 1 else None


def _angle_about(start: Float, end: Float, axis: Float) -> float:
    """Computes the angle about the axis from one direction to another, in radians in [0, 2 pi)."""
    a, b = start - (start @ axis) * axis, end - (end @ axis) * axis
    return float(np.arctan2(np.cross(a, b) @ axis, a @ b) % (2 * np.pi))


def _find_mirrored_pairs(
    body: LimbShapes, joint: int, similar: list[int], settings: SymmetrySettings
) -> list[EqualLimbs]:
    """Returns all pairs that are equal under reflection in a plane through the joint."""
    groups = []
    for a, b in itertools.combinations(similar, 2):
        normal = _unit_vector(body.middle[a] - body.middle[b])
        if normal is None:
            continue
        if normal[int(np.argmax(np.abs(normal)))] < 0.0:
            normal = -normal
        linear = np.eye(3) - 2.0 * np.outer(normal, normal)
        matched = body.match(joint, a, b, linear, settings.tolerance)
        if matched is not None:
            limbs = (
                EqualLimb(tuple(first for first, _ in matched.pairs), np.eye(3), 0.0),
                EqualLimb(tuple(other for _, other in matched.pairs), linear, matched.error),
            )
            groups.append(EqualLimbs("mirror", joint, normal, limbs))
    return groups


def _select_pairs_by_plane(groups: list[EqualLimbs], body: LimbShapes) -> list[EqualLimbs]:
    """Selects mirrored pairs such that each limb occurs once. The pairs of a plane that is shared by pairs
    with a large total bone length have priority."""
    axes = np.array([group.axis for group in groups]).reshape(-1, 3)
    weights = np.array([body.length[group.limbs[0].joints[0]] for group in groups])
    plane_weights = (np.abs(axes @ axes.T) > 0.98) @ weights
    chosen, used_limbs = [], set[int]()
    for i in sorted(range(len(groups)), key=lambda i: (-round(float(plane_weights[i]), 9), groups[i].joint)):
        limb_joints = {limb.joints[0] for limb in groups[i].limbs}
        if not limb_joints & used_limbs:
            chosen.append(groups[i])
            used_limbs |= limb_joints
    return chosen


def _unit_vector(vector: Float) -> Float | None:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-9 else None
