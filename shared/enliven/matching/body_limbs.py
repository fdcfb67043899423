"""The limbs of a body that select and drive parts of a skeleton. They are branches of a matching source, with
their chains of joints."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from enliven.matching.source import MatchSource, match_source_from_joints
from enliven.person import Body, Joint, parse_parts

LIMBS: dict[str, tuple[Joint, ...]] = {
    "head": (Joint.SHOULDER_CENTER, Joint.HEAD),
    "left arm": (
        Joint.SHOULDER_CENTER, Joint.SHOULDER_LEFT, Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.HAND_LEFT
    ),
    "right arm": (
        Joint.SHOULDER_CENTER, Joint.SHOULDER_RIGHT, Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT, Joint.HAND_RIGHT
    ),
    "left leg": (Joint.HIP_CENTER, Joint.HIP_LEFT, Joint.KNEE_LEFT, Joint.ANKLE_LEFT, Joint.FOOT_LEFT),
    "right leg": (Joint.HIP_CENTER, Joint.HIP_RIGHT, Joint.KNEE_RIGHT, Joint.ANKLE_RIGHT, Joint.FOOT_RIGHT),
}  # fmt: skip
"""The chains of joints of a person's limbs, from the trunk outwards."""
_TRUNK_CHAIN = (Joint.HIP_CENTER, Joint.SPINE, Joint.SHOULDER_CENTER, Joint.HEAD)
"""The chain of the trunk, from the hips to the head."""
_LIMB_CHAINS = (*LIMBS.values(), _TRUNK_CHAIN)
"""The chain of each limb, indexed by the limb's number. The trunk is the last."""


def limb_number(chain: Sequence[int]) -> int:
    """Returns the number of the limb that a chain of a body's joints belongs to, or -1 for none."""
    joints = tuple(int(joint) for joint in chain)
    equal_limbs = [number for number, limb in enumerate(_LIMB_CHAINS) if joints == tuple(map(int, limb))]
    limbs_with_tip = [number for number, limb in enumerate(_LIMB_CHAINS) if joints and joints[-1] in limb[1:]]
    return (equal_limbs or limbs_with_tip or [-1])[0]


def joints_of_limb(number: int) -> tuple[int, ...]:
    """Returns the joints at the outer ends of a limb's bones, or none for an unknown number."""
    is_valid = 0 <= number < len(_LIMB_CHAINS)
    return tuple(int(joint) for joint in _LIMB_CHAINS[number][1:]) if is_valid else ()


@dataclass(frozen=True, eq=False)
class BodySource:
    """The limbs of a body that select and drive parts of a skeleton.

    Attributes:
        source: the limbs as branches around one point of the trunk.
        chains: for each branch, its joints from the trunk outwards. Successive joints are neighbours in the
            body's tree.
    """

    source: MatchSource
    chains: tuple[tuple[Joint, ...], ...]


def body_source(body: Body, parts: str) -> BodySource:
    """Returns the limbs that the given body parts belong to, with the lengths of this body's bones.

    If all limbs are attached to the same end of the trunk, they begin at this end. Otherwise, all begin at
    the middle of the trunk. If only parts of the trunk are given, the source is one chain from the hips to
    the head.

    Raises:
        InputError: if a part is unknown.
    """
    named_parts = parse_parts(parts)
    chains = [chain for chain in LIMBS.values() if named_parts & set(chain[1:])]
    if not chains or named_parts <= set(_TRUNK_CHAIN) - {Joint.HEAD}:
        chains = [_TRUNK_CHAIN]
    starts = {chain[0] for chain in chains}
    root = starts.pop() if len(starts) == 1 else Joint.SPINE
    links = [(int(root), int(chain[1])) for chain in chains]
    links += [(int(a), int(b)) for chain in chains for a, b in itertools.pairwise(chain[1:])]
    joints = {int(root), *(int(joint) for chain in chains for joint in chain[1:])}
    source = match_source_from_joints(body.joints, links, int(root), joints)
    by_tip = {int(chain[-1]): chain for chain in chains}
    return BodySource(source, tuple(by_tip[branch.extended[-1]] for branch in source.branches))
