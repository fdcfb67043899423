"""Converts the poses of one performer to another performer's joints, size and facing direction.

The key poses and the take may be from different performers, such as an adult and a child. Poses are compared
by joints in the body frame, so every performer is converted to one reference performer:

- joints are matched by name, or otherwise by body part (:mod:`enliven.skeletons.anatomy`),
- positions are scaled joint by joint, by the joint's distance from the root along the bones,
- the facing direction is turned to that of the reference.

    role = match_performer(reference, clip.skeleton, ("LeftHand", "Head"), "walk")
    poses = role.seen(performed(clip, role.joints).poses)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton
from enliven.errors import InputError
from enliven.skeletons.anatomy import Anatomy, find_anatomy
from enliven.skeletons.facing import rotate_about_y

_SAME_SKELETON_TOLERANCE = 1e-9
"""Maximum difference between the joints of equal skeletons, as a fraction of the skeleton's size."""


@dataclass(frozen=True, eq=False)
class ReferenceConversion:
    """The conversion from a performer to the reference.

    Attributes:
        joints: (P,) names of the corresponding joints of this performer.
        factors: (P,) ratio of the reference's size to the performer's, per joint.
        turn: radians about +Y from the performer's facing direction to the reference's.
        notes: sentences about the joints that were matched by body part.
        size: leg length of the reference divided by that of this performer; without legs, the ratio of
            overall sizes.
    """

    joints: tuple[str, ...]
    factors: Float
    turn: float
    notes: tuple[str, ...] = ()
    size: float = 1.0

    def convert_poses(self, poses: Float) -> Float:
        """Converts poses (..., P, 3) of this performer, in the body frame, to poses of the reference."""
        if self.turn == 0.0 and (self.factors == 1.0).all():
            return poses
        return rotate_about_y(poses * self.factors[:, None], np.asarray(self.turn))


def match_performer(
    reference: Skeleton, skeleton: Skeleton, joints: Sequence[str], take_name: str = "performer"
) -> ReferenceConversion:
    """Finds the joints of a skeleton that correspond to the reference's joints, and the scale of each joint.

    Args:
        take_name: the take's name, for messages.

    Raises:
        InputError: if the skeleton has neither the named joint nor a corresponding one. The message lists the
            skeleton's joints.
    """
    if reference is skeleton or _is_same_performer(reference, skeleton):
        for name in joints:
            _check_joint(skeleton, name, take_name)
        return ReferenceConversion(tuple(joints), np.ones(len(joints)), 0.0)
    own_joints, notes = list[str](), list[str]()
    parts: tuple[Anatomy, Anatomy] | None = None
    for name in joints:
        if name in skeleton.names:
            own_joints.append(name)
            continue
        _check_joint(reference, name, take_name)
        parts = parts or (find_anatomy(reference), find_anatomy(skeleton))
        counterpart = _counterpart_joint(reference, skeleton, *parts, reference.names.index(name))
        if counterpart is None:
            _check_joint(skeleton, name, take_name)
        else:
            own_joints.append(skeleton.names[counterpart])
            notes.append(f"{take_name}: the joint {own_joints[-1]!r} is used instead of {name!r}")
    factors = np.ones(len(joints))
    for k, (name, own_joint) in enumerate(zip(joints, own_joints, strict=True)):
        if name in reference.names:
            reference_reach, own_reach = (
                _distance_from_root(reference, name),
                _distance_from_root(skeleton, own_joint),
            )
            factors[k] = reference_reach / own_reach if reference_reach > 0.0 and own_reach > 0.0 else 1.0
    parts = parts or (find_anatomy(reference), find_anatomy(skeleton))
    heading_change, size = parts[0].facing - parts[1].facing, _size_ratio(reference, skeleton, *parts)
    return ReferenceConversion(tuple(own_joints), factors, heading_change, tuple(notes), size)


def _is_same_performer(a: Skeleton, b: Skeleton) -> bool:
    """Returns True if two skeletons belong to the same performer."""
    if a.names != b.names or not np.array_equal(a.parents, b.parents):
        return False
    return bool(
        np.allclose(
            a.vectors, b.vectors, rtol=0.0, atol=_SAME_SKELETON_TOLERANCE * (float(a.lengths.sum()) or 1.0)
        )
    )


def _size_ratio(reference: Skeleton, skeleton: Skeleton, theirs: Anatomy, ours: Anatomy) -> float:
    """Returns the size of the reference divided by that of a performer. The size is the leg length, or the
    overall size if one of the two has no legs.
    """
    legs = _leg_length(reference, theirs), _leg_length(skeleton, ours)
    if min(legs) <= 0.0:
        legs = (
            float(np.ptp(reference.positions, axis=0).max()),
            float(np.ptp(skeleton.positions, axis=0).max()),
        )
    return legs[0] / legs[1] if min(legs) > 0.0 else 1.0


def _leg_length(skeleton: Skeleton, anatomy: Anatomy) -> float:
    """Returns the mean leg length along the bones, metres; 0 without legs."""
    legs = [skeleton.lengths[list(limb.proper[1:])].sum() for pair in anatomy.legs for limb in pair]
    return float(np.mean(legs)) if legs else 0.0


def _check_joint(skeleton: Skeleton, name: str, take_name: str) -> None:
    """Raises InputError if a skeleton has no joint with this name."""
    if name not in skeleton.names:
        advice = f"Known joints: {', '.join(skeleton.names)}."
        raise InputError(
            f"the take has neither a joint {name!r} nor a similar joint",
            where=f"take {take_name!r}",
            remedy=advice,
        )


def _distance_from_root(skeleton: Skeleton, name: str) -> float:
    """Returns the distance from the root to a joint along the bones, metres."""
    return float(skeleton.lengths[list(skeleton.path(0, skeleton.index(name)))].sum())


def _counterpart_joint(
    reference: Skeleton, skeleton: Skeleton, theirs: Anatomy, ours: Anatomy, joint: int
) -> int | None:
    """Returns the joint that corresponds to ``joint`` of the reference: on the same body part, at the same
    fraction of its length.
    """
    if joint == 0:
        return 0
    parts, own_chains = _body_chains(theirs), _body_chains(ours)
    ancestor = joint
    while ancestor >= 0:
        for name, chain in parts.items():
            if ancestor in chain[1:] and name in own_chains:
                fractions = _chain_positions(skeleton, own_chains[name])
                arc_position = _chain_positions(reference, chain)[chain.index(ancestor)]
                return own_chains[name][int(np.abs(fractions - arc_position).argmin())]
        ancestor = int(reference.parents[ancestor])
    return None


def _body_chains(anatomy: Anatomy) -> dict[tuple[str, int, int], tuple[int, ...]]:
    """Returns the chains of joints of a body. The key is the chain's kind, number and side."""
    parts = {("trunk", 0, 0): anatomy.trunk}
    for kind, pairs in (("arm", anatomy.arms), ("leg", anatomy.legs)):
        for number, pair in enumerate(pairs):
            for side, limb in enumerate(pair):
                parts[kind, number, side] = limb.chain
    for kind, single in (("head", anatomy.head), ("tail", anatomy.tail)):
        if single is not None:
            parts[kind, 0, 0] = single.chain
    return parts


def _chain_positions(skeleton: Skeleton, chain: tuple[int, ...]) -> Float:
    """Returns the position (K,) of each joint along a chain, as a fraction (0 to 1) of the chain's length."""
    arc_lengths = np.concatenate([[0.0], np.cumsum(skeleton.lengths[list(chain[1:])])])
    return np.asarray(arc_lengths / max(float(arc_lengths[-1]), 1e-12))
