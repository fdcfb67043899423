"""Assigns limbs of a take (the source) to limbs of a model (the target): legs to legs, arms to arms or wings.

Each limb is driven by a source limb of its kind, in the order from front and top to back and bottom:

- Pairs of legs that stand on the floor are driven by pairs of legs, the rearmost first. If the target has
  more pairs, the arms drive its foremost pair (a horse's forelegs). The same legs of the source drive the
  other pairs too, with the sides exchanged and the motion mirrored. So neighbouring legs step alternately,
  like an insect's legs.
- Other pairs (arms, wings, flippers) are driven by arms, or by the foremost legs if the source has no arms.
- The head drives the head, together with the trunk if only one of the two skeletons has a trunk.
- A tail is driven by the tail, or by the spine if the source has no tail. The tail of a target without limbs
  (a snake) is driven by a leg.

Left limbs drive left limbs. But if one source pair drives several target pairs, the sides are exchanged from
each target pair to the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from enliven.skeletons.anatomy import Anatomy, Pair, SkeletonLimb

_MAX_ARC_DIFFERENCE = 0.21
"""Maximum difference in relative arc length (0 to 1) between corresponding joints of two limbs with different
numbers of segments."""


@dataclass(frozen=True)
class Drive:
    """A chain of the source and the chain of the target that it drives.

    Attributes:
        source, target: the joints of the two chains, beginning with the joint about which the chain rotates.
        role: the name of the limb in the mapping file.
        lead: source joints before ``source``, such as a girdle. Their rotations are added to the first part
            of the target chain.
        mirrored: True if the source is a limb of the other side and its motion is mirrored.
        knots: pairs (source joint, target joint) of inner joints that correspond by their names, such as
            elbows.
    """

    source: tuple[int, ...]
    target: tuple[int, ...]
    role: str
    lead: tuple[int, ...] = ()
    mirrored: bool = False
    knots: tuple[tuple[int, int], ...] = ()


def assign_limbs(source: Anatomy, target: Anatomy) -> list[Drive]:
    """Returns the drives of all parts of a body, except the drive that rotates the whole body."""
    drives: list[Drive] = []
    replacement_arms = _replacement_legs(source, target)
    for (left, right), (from_left, from_right), role in _pair_matches(source, target, replacement_arms):
        is_mirrored = any(from_left is pair[1] for pair in source.pairs)
        for limb, source_limb, side in ((left, from_left, "left"), (right, from_right, "right")):
            for drive in _make_limb_drives(source_limb, limb, f"{side} {role}"):
                drives.append(replace(drive, mirrored=is_mirrored))
    drives += _make_middle_drives(source, target)
    drives += _make_tail_drives(source, target)
    return [drive for drive in drives if len(drive.source) > 1 and len(drive.target) > 1]


def _replacement_legs(source: Anatomy, target: Anatomy) -> tuple[Pair, ...]:
    """Returns the pairs of source legs that drive the target's arms if the source has no arms."""
    spare_pairs = len(source.legs) - max(len(target.legs), 1)
    return source.legs[: max(spare_pairs, 0)] or source.legs[:1]


def _pair_matches(
    source: Anatomy, target: Anatomy, replacement_arms: tuple[Pair, ...]
) -> list[tuple[Pair, Pair, str]]:
    """Returns (target pair, source pair, role) for every pair of the target that can be driven."""
    driven_pairs: list[tuple[Pair, Pair, str]] = []
    arms = source.arms or replacement_arms
    legs = source.legs or source.arms
    target_legs = list(target.legs)
    if target_legs and legs:
        pair_count = min(len(target_legs), len(legs))
        rear_pairs = zip(
            target_legs[len(target_legs) - pair_count :], legs[len(legs) - pair_count :], strict=True
        )
        for number, (pair, source_pair) in enumerate(rear_pairs, 1):
            driven_pairs.append((pair, source_pair, "leg" if pair_count == 1 else f"leg {number}"))
        front_legs = target_legs[: len(target_legs) - pair_count]
        if front_legs and source.arms:
            driven_pairs.append((front_legs[0], source.arms[0], "foreleg"))
            front_legs = front_legs[1:]
        for number, pair in enumerate(reversed(front_legs), 1):
            driven_pairs.append((pair, _exchange_sides(legs[0], number), f"leg {pair_count + number}"))
    for number, pair in enumerate(target.arms):
        if not arms:
            break
        source_pair = (
            arms[number] if number < len(arms) else _exchange_sides(arms[-1], number - len(arms) + 1)
        )
        driven_pairs.append((pair, source_pair, "arm" if number == 0 else f"arm {number + 1}"))
    return driven_pairs


def _exchange_sides(pair: Pair, times: int) -> Pair:
    """Returns the pair with its sides exchanged ``times`` times."""
    return (pair[1], pair[0]) if times % 2 else pair


def _make_limb_drives(source: SkeletonLimb, target: SkeletonLimb, role: str) -> list[Drive]:
    """Returns the drives of the girdle, the limb, and the hand or foot, as far as both limbs have these
    parts.

    If only the source has a girdle, its rotations are added to the limb's rotations. If an animal's leg has
    no separate foot, the performer's leg together with its foot drives it.
    """
    girdles = len(source.girdle) > 1 and len(target.girdle) > 1
    are_like_arms = not target.grounded and len(source.main) == len(target.main)
    source_chain = source.main if target.tip or target.knots or are_like_arms else source.proper
    lead = () if girdles else source.girdle[:-1]
    drives = [Drive(source.girdle, target.girdle, f"{role} girdle")] if girdles else []
    drives.append(Drive(source_chain, target.main, role, lead, knots=_match_joints(source, target)))
    if source.tip and target.tip:
        drives.append(Drive(source.tip, target.tip, f"{role} end"))
    return drives


def _match_joints(source: SkeletonLimb, target: SkeletonLimb) -> tuple[tuple[int, int], ...]:
    """Returns pairs (source, target) of joints in two limbs that correspond by name, such as elbows."""
    if not source.knots or len(source.knots) != len(target.knots):
        return ()
    knot_pairs = zip(source.knots, target.knots, strict=True)
    return tuple((source.chain[a], target.chain[b]) for a, b in knot_pairs)


def _make_middle_drives(source: Anatomy, target: Anatomy) -> list[Drive]:
    """Returns the drives of the trunk and the head."""
    head = source.head.chain if source.head else ()
    if len(target.trunk) > 1 and target.head and target.head.chain[0] == target.trunk[-1]:
        if len(source.trunk) > 1 and head and head[0] == source.trunk[-1]:
            assert source.head is not None
            knots = _match_joints(source.head, target.head)
            return [
                Drive(source.trunk, target.trunk, "trunk"),
                Drive(head, target.head.chain, "head", knots=knots),
            ]
        source_chain = head or source.trunk
        return [Drive(source_chain, (*target.trunk, *target.head.chain[1:]), "trunk and head")]
    trunk_and_head = _join_trunk_and_head(source.trunk, head)
    drives = []
    if len(target.trunk) > 1:
        drives.append(Drive(source.trunk if len(source.trunk) > 1 else trunk_and_head, target.trunk, "trunk"))
    if target.head:
        drives.append(Drive(trunk_and_head, target.head.chain, "head"))
    return drives


def _join_trunk_and_head(trunk: tuple[int, ...], head: tuple[int, ...]) -> tuple[int, ...]:
    """Returns trunk and head as one chain if the head continues the trunk. Otherwise returns the head, or the
    trunk if the head is missing."""
    if head and head[0] == trunk[-1]:
        return (*trunk, *head[1:])
    return head or trunk


def _make_tail_drives(source: Anatomy, target: Anatomy) -> list[Drive]:
    if target.tail is None:
        return []
    if source.tail:
        return [Drive(source.tail.chain, target.tail.chain, "tail")]
    legs = source.legs or source.arms
    if legs and not target.pairs:
        return [Drive(legs[0][0].chain, target.tail.chain, "tail")]
    trunk_and_head = _join_trunk_and_head(source.trunk, source.head.chain if source.head else ())
    return [Drive(trunk_and_head, target.tail.chain, "tail")]


def split_drive(drive: Drive, cuts: Sequence[tuple[int, int]]) -> list[Drive]:
    """Splits a drive at corresponding inner joints, so that an elbow drives an elbow, and returns the pieces.

    Within a piece, points correspond by arc length alone, as in AniMesh (section 5.1).

    Args:
        drive: the drive.
        cuts: indices (in ``source``, in ``target``) of corresponding joints, both ascending.
    """
    ends = [(0, 0), *cuts, (len(drive.source) - 1, len(drive.target) - 1)]
    pieces = [
        replace(drive, source=drive.source[a : c + 1], target=drive.target[b : d + 1], lead=(), knots=())
        for (a, b), (c, d) in pairwise(ends)
    ]
    first = replace(pieces[0], source=(*drive.lead, *pieces[0].source))
    return [first, *pieces[1:]]


def match_joints(drive: Drive, source_arc: list[float], target_arc: list[float]) -> list[tuple[int, int]]:
    """Returns indices (in the source, in the target) of corresponding inner joints of a drive, ascending.

    Joints that are both named after the same human joint correspond. Without such names, two limbs with the
    same number of segments correspond joint by joint. Other limbs correspond at joints of similar arc length.

    Args:
        drive: the drive.
        source_arc, target_arc: arc length 0..1 at the joints of the chains.
    """
    if drive.knots:
        cuts = [(drive.source.index(a), drive.target.index(b)) for a, b in drive.knots]
        return [(a, b) for a, b in cuts if 0 < a < len(drive.source) - 1 and 0 < b < len(drive.target) - 1]
    return _match_inner_joints(source_arc, target_arc, _MAX_ARC_DIFFERENCE)


def match_joints_of_poses(
    source_arc: list[float], target_arc: list[float], source_tip: int, target_tip: int
) -> list[tuple[int, int]]:
    """Returns indices (in the source, in the target) of corresponding inner joints of two limbs, ascending.

    This function is for limbs that get the performer's pose. Wrist corresponds to wrist and ankle to ankle,
    so the proportions of hands and feet do not matter. Above them any difference in arc length is allowed:
    an arm without an elbow could not bend.

    Args:
        source_arc, target_arc: arc length 0..1 at the joints of the chains.
        source_tip, target_tip: indices of the joints at which the hands or feet begin. The last joint if the
            chain contains no hand or foot.
    """
    if source_tip == len(source_arc) - 1 or target_tip == len(target_arc) - 1:
        return _match_inner_joints(source_arc, target_arc, 1.0)
    above = _match_inner_joints(
        _compute_relative_arc(source_arc[: source_tip + 1]),
        _compute_relative_arc(target_arc[: target_tip + 1]),
        1.0,
    )
    below = _match_inner_joints(
        _compute_relative_arc(source_arc[source_tip:]),
        _compute_relative_arc(target_arc[target_tip:]),
        _MAX_ARC_DIFFERENCE,
    )
    return [*above, (source_tip, target_tip), *((source_tip + a, target_tip + b) for a, b in below)]


def _compute_relative_arc(arc: list[float]) -> list[float]:
    """Returns the arc length 0..1 at the joints of a part of a chain."""
    extent = max(arc[-1] - arc[0], 1e-9)
    return [(value - arc[0]) / extent for value in arc]


def _match_inner_joints(
    source_arc: list[float], target_arc: list[float], max_difference: float
) -> list[tuple[int, int]]:
    """Returns matches of inner joints: joint by joint if the numbers are equal, otherwise by arc length."""
    if len(source_arc) == len(target_arc):
        return [(k, k) for k in range(1, len(source_arc) - 1)]
    return joints_at_one_arc(source_arc, target_arc, max_difference)


def joints_at_one_arc(
    first_arc: list[float], second_arc: list[float], max_difference: float
) -> list[tuple[int, int]]:
    """Returns pairs of indices of inner joints at nearly the same arc length, ascending.

    The result is the largest possible set of pairs, and among sets of this size the one with the smallest
    differences in arc length. It is computed by dynamic programming.

    Args:
        first_arc, second_arc: arc length 0..1 at the joints of two chains.
        max_difference: maximum difference in arc length of two joints that correspond.
    """
    rows, columns = len(first_arc) - 2, len(second_arc) - 2
    best: dict[tuple[int, int], tuple[float, tuple[tuple[int, int], ...]]] = {}

    def choose_best_pairs(i: int, j: int) -> tuple[float, tuple[tuple[int, int], ...]]:
        if i == 0 or j == 0:
            return 0.0, ()
        if (i, j) not in best:
            options = [choose_best_pairs(i - 1, j), choose_best_pairs(i, j - 1)]
            difference = abs(first_arc[i] - second_arc[j])
            if difference <= max_difference:
                score, pairs = choose_best_pairs(i - 1, j - 1)
                options.append((score + 1.0 - difference, (*pairs, (i, j))))
            best[i, j] = max(options, key=lambda option: option[0])
        return best[i, j]

    return list(choose_best_pairs(rows, columns)[1])
