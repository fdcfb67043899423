"""Finds the anatomy of a skeleton: a trunk, pairs of limbs on its sides, a head and a tail.

An upright skeleton with the joint names of a person (:mod:`enliven.skeletons.human_names`) is divided by the
names, so that weapons, hair, capes and twist bones do not count as limbs. Every other skeleton is divided by
geometry. In this case, small branches (twigs) such as fingers, ears and a jaw are ignored first. A branch at
a fork is small if its name indicates a part of a face or a hand. It is also small if it is short compared
with the whole skeleton, or with the path from the root to the fork. The remaining joints form chains between
forks and ends. Chains between forks form the trunk, and chains to an end are limbs. Two limbs that mirror
each other form a pair. Among the unpaired limbs, the head is the one that extends farthest forward and up,
and the tail is the one that extends farthest backward and down.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Bool, Float
from enliven.document import Skeleton
from enliven.skeletons.facing import find_facing, rotate_about_y, separate_words, side_from_name
from enliven.skeletons.human_names import HumanJoints, HumanLimb, find_human_joints, find_longest_branch
from enliven.skeletons.weak_cache import cache_while_alive

_TWIG_WORDS = re.compile(
    r"(?<![a-z])(eye|eye ?lid|(eye ?)?brow|ear|jaw|mouth|lip|tongue|tooth|teeth|nose|cheek|hair|finger|thumb)"
    r"s?(?![a-z])",
    re.IGNORECASE,
)
"""Pattern of words in joint names for a part of a face or a hand."""
_PARTNER_DISTANCE = 0.02
"""Maximum distance between a joint and the mirror image of its partner, as a fraction of the skeleton's
size."""
_MIN_BRANCH_FRACTION = 0.15
"""Minimum length of a limb, as a fraction of the longest branch. A shorter branch is a twig."""
_MIN_FORK_FRACTION = 0.5
"""Minimum length of a limb, as a fraction of the path from the root to its fork. A shorter branch is a twig.

The same fraction defines the branches that lead away from the middle plane. Their end is farther from this
plane than their fork by more than this fraction of the branch's length.
"""
_MIN_SIDE_FORK_FRACTION = 0.6
"""Replaces ``_MIN_FORK_FRACTION`` for a branch that leads away from the middle plane, because big ears are
longer than other twigs."""
_MIN_FORK_BRANCHES = 5
"""Minimum number of branches at a fork that is a face or a hand. The rule does not apply to the root."""
_MIN_PALM_LENGTH = 0.02
"""Minimum length of a palm's bone (to the first joint of a finger), as a fraction of the longest branch."""
_MAX_FORK_OFFSET = 0.15
"""Maximum distance of a fork from the middle plane, as a fraction of the longest branch. A fork beyond it is
a hand, and the limb continues only along its longest branch."""
_MAX_PAIR_DIFFERENCE = 0.15
"""Maximum relative difference in length of the two limbs of a pair."""
_MIN_PAIR_DISTANCE = 0.1
"""Minimum lateral distance between the two limbs of a pair, as a fraction of their length."""
_MIN_LIMB_OFFSET = 0.03
"""Minimum distance from the middle plane, as a fraction of the limb's length, at which the limb proper
(without collar bone or hip bone) begins."""
_MIN_GIRDLE_SIDEWAYS = 0.8
"""Minimum lateral extent of a girdle bone (collar bone, hip), as a fraction of its length."""
_MAX_GIRDLE_COSINE = 0.5
"""Maximum cosine of the angle between a girdle bone and the rest of the limb. The limb bends by at least 60
degrees at this joint."""
_MAX_GIRDLE_LENGTH = 0.6
"""Maximum length of the girdle, as a fraction of the limb's length. A longer girdle would leave too little of
the limb."""
_MIN_LEG_JOINTS = 3
"""Minimum number of joints of a leg without its girdle. With fewer joints, it could not bend."""
_MIN_FIRST_BONE = 0.7
"""Minimum length of the first bone of the limb proper, as a fraction of the limb's second longest bone."""
_MAX_LEG_END_HEIGHT = 0.15
"""Maximum height of a leg's end above the floor, as a fraction of body height. It allows for legs that end at
the ankle."""
_MIN_LEG_DROP = 0.12
"""Minimum height difference between the highest joint of a leg and its end, as a fraction of body height. It
excludes tails close to the ground."""
_MAX_HAND_LENGTH = 0.45
"""Maximum length of a hand, as a fraction of the limb's length. The two segments of the arm are longer."""
_MIN_WRIST_POSITION = 0.6
"""Minimum position of a wrist or an ankle, as a fraction of the limb's length. A segment that begins beyond
it is a hand or a foot."""
_MIN_WRIST_BONES = 3
"""Minimum number of bones that begin at a wrist. At a joint with only two bones, one may be a twist bone."""
_MAX_FINGER_SPREAD = 1.0 / 3.0
"""Maximum distance between the first joints of two fingers with parallel first bones, as a fraction of the
length of these bones. The bones of a palm spread more."""
_MIN_UPRIGHT_COSINE = np.cos(np.radians(45.0))
"""Minimum cosine of the angle between the vertical and the line from hips to chest at which human joint names
are used. Animals may have human joint names too."""


@dataclass(frozen=True)
class SkeletonLimb:
    """A chain of joints from a fork to an end.

    Attributes:
        chain: its joints, beginning with the fork.
        start: index in the chain at which the limb proper begins. The girdle (collar bone, hip) is before it.
        grounded: True if the limb stands on the floor.
        end: (3,) position of its end, metres, in a frame in which the body faces +Z and its left side is +X.
        stop: index in the chain at which the hand or foot begins (wrist, ankle). None without a separate hand
            or foot.
        knots: indices in the chain at which segments begin and the last segment ends, determined from joint
            names. For an arm: shoulder, elbow, wrist. For a leg: hip, knee, ankle. For a head: neck and head,
            or the head alone. Empty if the names do not determine them.
    """

    chain: tuple[int, ...]
    start: int
    grounded: bool
    end: tuple[float, float, float]
    stop: int | None = None
    knots: tuple[int, ...] = ()

    @property
    def proper(self) -> tuple[int, ...]:
        """The limb proper: the chain without its girdle."""
        return self.chain[self.start :]

    @property
    def girdle(self) -> tuple[int, ...]:
        """The joints from the fork to the beginning of the limb proper, both included."""
        return self.chain[: self.start + 1]

    @property
    def main(self) -> tuple[int, ...]:
        """The limb proper without its hand or foot."""
        return self.proper if self.stop is None else self.chain[self.start : self.stop + 1]

    @property
    def tip(self) -> tuple[int, ...]:
        """The joints of the first bone of its hand or foot. Empty if it has no separate hand or foot."""
        return () if self.stop is None else self.chain[self.stop : self.stop + 2]


Pair = tuple[SkeletonLimb, SkeletonLimb]
"""The left limb and the right limb."""


@dataclass(frozen=True)
class Anatomy:
    """The parts of a skeleton.

    Attributes:
        facing: angle of its front about +Y from +Z, in radians.
        trunk: the joints from the root, or from the hips below it, to the last fork. It is the root alone if
            there is at most one fork.
        pairs: pairs of limbs (left, right), the foremost and uppermost first.
        head, tail: chains on the middle plane, or None.
    """

    facing: float
    trunk: tuple[int, ...]
    pairs: tuple[Pair, ...]
    head: SkeletonLimb | None
    tail: SkeletonLimb | None

    @property
    def legs(self) -> tuple[Pair, ...]:
        """The pairs of limbs that stand on the floor, the foremost first."""
        return tuple(pair for pair in self.pairs if pair[0].grounded)

    @property
    def arms(self) -> tuple[Pair, ...]:
        """The pairs of limbs that do not stand on the floor, the uppermost first."""
        return tuple(pair for pair in self.pairs if not pair[0].grounded)


def is_tip_start(skeleton: Skeleton, limb: SkeletonLimb, joint: int) -> bool:
    """Returns True if a hand or foot begins at a joint, based on lengths.

    Returns False if joint names or fingers already define the limb's hand or foot, and for an elbow: an arm
    has two segments before its hand.
    """
    inner_joints = limb.main[1:-1] if limb.grounded else limb.main[2:-1]
    if limb.tip or limb.knots or joint not in inner_joints:
        return False
    number, bones = limb.main.index(joint), skeleton.lengths[list(limb.main[1:])]
    return bool(bones[:number].sum() > _MIN_WRIST_POSITION * bones.sum())


def tip_number(skeleton: Skeleton, limb: SkeletonLimb) -> int:
    """Returns the index in ``limb.proper`` at which the hand or foot begins.

    Returns the index of the last joint if the limb has no hand or foot.
    """
    if limb.tip or limb.knots:
        return len(limb.main) - 1
    starts = (k for k, joint in enumerate(limb.main) if is_tip_start(skeleton, limb, joint))
    return next(starts, len(limb.main) - 1)


def has_parallel_fingers(skeleton: Skeleton, joint: int) -> bool:
    """Returns True if other fingers begin next to a joint, and the rig has no wrist that moves them together.

    Their first bones all begin at the elbow and lead along the forearm.
    """
    if joint == 0:
        return False
    place, max_distance = skeleton.positions[joint], _MAX_FINGER_SPREAD * skeleton.lengths[joint]
    siblings = skeleton.children[int(skeleton.parents[joint])]
    return any(
        bool(skeleton.children[sibling])
        and float(np.linalg.norm(skeleton.positions[sibling] - place)) < max_distance
        for sibling in siblings
        if sibling != joint
    )


def find_anatomy(skeleton: Skeleton, facing: float | None = None) -> Anatomy:
    """Finds the parts of a skeleton at rest.

    Args:
        skeleton: the skeleton.
        facing: heading of the skeleton's front: angle about +Y from +Z, radians. If None, it is detected.
    """
    return _detect_anatomy(skeleton) if facing is None else _find_anatomy(skeleton, facing)


@cache_while_alive
def _detect_anatomy(skeleton: Skeleton) -> Anatomy:
    """Finds the parts of a skeleton, with the detected heading of its front."""
    return _find_anatomy(skeleton, find_facing(skeleton))


def _find_anatomy(skeleton: Skeleton, facing: float) -> Anatomy:
    """Finds the parts of a skeleton with a known heading of its front."""
    positions = _symmetrize_positions(
        rotate_about_y(skeleton.positions - skeleton.positions[0] * [1.0, 0.0, 1.0], -facing)
    )
    human = find_human_joints(skeleton)
    if human is not None and _points_up(positions[human.chest] - positions[list(_hip_joints(human))].mean(0)):
        return _anatomy_from_names(skeleton, human, facing, positions)
    children = _find_major_children(skeleton, positions)
    chains = _fork_chains(children)
    limbs = [
        _separate_hand(_limb_from_chain(chain, positions), skeleton, positions)
        for chain in chains
        if not children[chain[-1]]
    ]
    trunk = _trunk_path([chain for chain in chains if children[chain[-1]]], positions)
    pairs, unpaired = _find_paired_limbs(limbs, positions, skeleton.names)
    head, tail = _head_and_tail(unpaired, positions)
    if not any(limb.chain[0] == trunk[-1] for limb in unpaired):
        trunk, pairs, split_head = _separate_head(trunk, pairs, positions)
        head = split_head or head
    return Anatomy(facing, trunk, tuple(pairs), head, tail)


def _hip_joints(human: HumanJoints) -> tuple[int, ...]:
    """Returns the two joints at which the legs of a person begin."""
    return tuple(leg.knots[0] for leg in human.legs)


def _points_up(vector: Float) -> bool:
    """Returns True if a vector (3,) points up."""
    return bool(float(vector[1]) > _MIN_UPRIGHT_COSINE * float(np.linalg.norm(vector)))


def _anatomy_from_names(skeleton: Skeleton, human: HumanJoints, facing: float, at: Float) -> Anatomy:
    """Returns the anatomy of a person from the joint names. The front is at +Z in ``at`` (N, 3)."""
    path = skeleton.path(human.hips, human.chest)
    # The root may be on the floor or in the belly, so begin the trunk at the joint nearest to the hips.
    hip_centre = at[list(_hip_joints(human))].mean(0)
    trunk_start = min(
        range(max(len(path) - 1, 1)), key=lambda k: float(np.linalg.norm(at[path[k]] - hip_centre))
    )
    arms, legs = (
        tuple(_make_human_limb(skeleton, fork, limb, grounded, at) for limb in limbs)
        for fork, limbs, grounded in ((human.chest, human.arms, False), (human.hips, human.legs, True))
    )
    head = None
    if len(human.head) > 1:
        knots = tuple(human.head.index(joint) for joint in human.head_knots)
        head = SkeletonLimb(human.head, 0, False, _limbs_to_tuples(at[human.head[-1]]), knots=knots)
    tail = None
    if human.tail:
        tail = SkeletonLimb(human.tail, 0, False, _limbs_to_tuples(at[human.tail[-1]]))
    return Anatomy(facing, path[trunk_start:], ((arms[0], arms[1]), (legs[0], legs[1])), head, tail)


def _make_human_limb(
    skeleton: Skeleton, fork: int, limb: HumanLimb, grounded: bool, at: Float
) -> SkeletonLimb:
    """Returns an arm or leg: the chain from the joint that the pair shares to the end of its hand or foot."""
    path = skeleton.path(fork, limb.knots[-1])
    chain = path if limb.tip < 0 else (*path, *find_longest_branch(skeleton, limb.tip))
    knots = tuple(path.index(joint) for joint in limb.knots)
    stop = None if limb.tip < 0 else len(path) - 1
    return SkeletonLimb(chain, knots[0], grounded, _limbs_to_tuples(at[chain[-1]]), stop, knots)


def _limbs_to_tuples(place: Float) -> tuple[float, float, float]:
    return float(place[0]), float(place[1]), float(place[2])


def _symmetrize_positions(at: Float) -> Float:
    """Returns symmetric joint positions (N, 3): the mean of each joint and its partner's mirror image.

    With symmetric positions, all decisions that depend on lengths are the same on both sides.
    """
    mirrored = at * [-1.0, 1.0, 1.0]
    distances = np.linalg.norm(at[:, None] - mirrored, axis=2)
    partner = distances.argmin(1)
    mutual = partner[partner] == np.arange(len(at))
    is_near = distances.min(1) < _PARTNER_DISTANCE * np.ptp(at, axis=0).max()
    return np.where((mutual & is_near)[:, None], (at + mirrored[partner]) / 2.0, at)


def _find_major_children(skeleton: Skeleton, at: Float) -> list[list[int]]:
    """Returns the children of each joint without twigs. A limb therefore ends at the first joint of a
    finger.
    """
    count, parents = len(skeleton), np.maximum(skeleton.parents, 0)
    lengths = np.linalg.norm(at - at[parents], axis=1)
    has_twig_name = [bool(_TWIG_WORDS.search(separate_words(name))) for name in skeleton.names]
    reach, path_lengths, end = np.zeros(count), np.zeros(count), np.arange(count)
    for j in range(count - 1, 0, -1):
        up, long = parents[j], reach[j] + lengths[j]
        if long >= reach[up]:
            reach[up], end[up] = long, end[j]
    for j in range(1, count):
        path_lengths[j] = path_lengths[parents[j]] + lengths[j]
    below: list[list[int]] = []
    for j, children in enumerate(skeleton.children):
        branches = []
        for c in children:
            long = reach[c] + lengths[c]
            aside = abs(at[end[c], 0] - at[j, 0]) > _MIN_FORK_FRACTION * long
            min_length = max(
                _MIN_BRANCH_FRACTION * reach[0],
                (_MIN_SIDE_FORK_FRACTION if aside else _MIN_FORK_FRACTION) * path_lengths[j],
            )
            if (long >= min_length and not has_twig_name[c]) or len(children) == 1:
                branches.append(c)
        if j > 0 and children and abs(at[j, 0]) > _MAX_FORK_OFFSET * reach[0]:
            branches = [max(children, key=lambda c: reach[c] + lengths[c])]
        is_fork = j > 0 and (
            (has_twig_name[j] and lengths[j] > _MIN_PALM_LENGTH * reach[0])
            or len(branches) >= _MIN_FORK_BRANCHES
        )
        below.append([] if is_fork else branches)
    return below


def _fork_chains(below: list[list[int]]) -> list[tuple[int, ...]]:
    """Returns the chains that begin at the root and at every fork, up to the next fork or end."""
    chains, waiting = list[tuple[int, ...]](), [0]
    while waiting:
        fork = waiting.pop(0)
        for child in below[fork]:
            chain = [fork, child]
            while len(below[chain[-1]]) == 1:
                chain.append(below[chain[-1]][0])
            chains.append(tuple(chain))
            if below[chain[-1]]:
                waiting.append(chain[-1])
    return chains


def _trunk_path(chains: list[tuple[int, ...]], at: Float) -> tuple[int, ...]:
    """Returns the longest path from the root along chains that end in a fork."""
    longest_path: tuple[int, ...] = (0,)
    paths: dict[int, tuple[int, ...]] = {0: (0,)}
    for chain in chains:
        if chain[0] in paths:
            paths[chain[-1]] = (*paths[chain[0]], *chain[1:])
            if _chain_length(paths[chain[-1]], at) > _chain_length(longest_path, at):
                longest_path = paths[chain[-1]]
    while len(longest_path) > 2 and _turns_back(at[list(longest_path)]):
        longest_path = longest_path[1:]
    return longest_path


def _turns_back(points: Float) -> bool:
    """Returns True if the first bone of a chain points away from the rest of the chain, like a bone from the
    belly to the hips.
    """
    return bool((points[1] - points[0]) @ (points[-1] - points[1]) < 0.0)


def _separate_head(
    trunk: tuple[int, ...], pairs: list[Pair], at: Float
) -> tuple[tuple[int, ...], list[Pair], SkeletonLimb | None]:
    """Separates a head with paired branches (ears) from the trunk. Returns the trunk, the pairs and the head.

    Such a head exists if the trunk ends in a fork with pairs that are not legs (ears), and an earlier fork
    also has such pairs (arms). The head is the part of the trunk after the arms. Otherwise, trunk and pairs
    are returned unchanged, and the head is None.
    """
    forks = [
        trunk.index(pair[0].chain[0]) for pair in pairs if pair[0].chain[0] in trunk and not pair[0].grounded
    ]
    if not forks or max(forks) != len(trunk) - 1 or min(forks) == len(trunk) - 1:
        return trunk, pairs, None
    neck = max(fork for fork in forks if fork < len(trunk) - 1)
    other_pairs = [pair for pair in pairs if pair[0].chain[0] != trunk[-1]]
    return trunk[: neck + 1], other_pairs, _limb_from_chain(trunk[neck:], at)


def _chain_length(chain: tuple[int, ...], at: Float) -> float:
    return float(np.linalg.norm(np.diff(at[list(chain)], axis=0), axis=1).sum())


def _limb_from_chain(chain: tuple[int, ...], at: Float) -> SkeletonLimb:
    """Converts a chain to a limb, and separates the girdle from the limb proper."""
    length = _chain_length(chain, at)
    bones = np.linalg.norm(np.diff(at[list(chain)], axis=0), axis=1)
    aside = np.abs(at[list(chain[:-1]), 0]) > _MIN_LIMB_OFFSET * length
    second = np.sort(bones[aside])[-2:][0] if aside.any() else 0.0
    limb = aside & (bones >= _MIN_FIRST_BONE * second) & ~_is_sideways(at[list(chain)])
    start = int(limb.argmax()) if limb.any() else 0
    floor, tall = float(at[:, 1].min()), float(np.ptp(at[:, 1]))
    end = at[chain[-1]]
    drop = float(at[list(chain), 1].max() - end[1])
    grounded = bool(end[1] < floor + _MAX_LEG_END_HEIGHT * tall and drop > _MIN_LEG_DROP * tall)
    while start and (
        _chain_length(chain[: start + 1], at) > _MAX_GIRDLE_LENGTH * length
        or (grounded and len(chain) - start < _MIN_LEG_JOINTS)
    ):
        start -= 1
    return SkeletonLimb(chain, start, grounded, _limbs_to_tuples(end))


def _separate_hand(limb: SkeletonLimb, skeleton: Skeleton, at: Float) -> SkeletonLimb:
    """Separates the hand of a limb. The hand begins at the joint near the end at which the fingers begin."""
    proper = limb.proper
    if limb.grounded or len(proper) < _MIN_LEG_JOINTS + 1:
        return limb
    length = _chain_length(proper, at)
    for number in range(_MIN_LEG_JOINTS - 1, len(proper) - 1):
        spreads = len(skeleton.children[proper[number]]) >= _MIN_WRIST_BONES
        if spreads and _chain_length(proper[number:], at) <= _MAX_HAND_LENGTH * length:
            return replace(limb, stop=limb.start + number)
    return limb


def _is_sideways(points: Float) -> Bool:
    """Returns (K - 1,) True for the bones that lead sideways at the start of a chain, before it bends as at a
    hip."""
    bones, rest = np.diff(points, axis=0), points[-1] - points[1:]
    lengths = np.linalg.norm(bones, axis=1) * np.maximum(np.linalg.norm(rest, axis=1), 1e-9)
    cosines = np.einsum("kc,kc->k", bones, rest) / np.maximum(lengths, 1e-12)
    is_lateral = np.abs(bones[:, 0]) > _MIN_GIRDLE_SIDEWAYS * np.linalg.norm(bones, axis=1)
    return np.asarray(is_lateral & (cosines < _MAX_GIRDLE_COSINE) & (np.arange(len(bones)) < len(bones) - 1))


def _find_paired_limbs(
    limbs: list[SkeletonLimb], at: Float, names: tuple[str, ...]
) -> tuple[list[Pair], list[SkeletonLimb]]:
    """Returns the pairs (left, right) from front and top to back and bottom, and the unpaired limbs.

    The limbs of a pair have similar lengths. Their positions have less influence, because a performer may
    hold them in different poses.
    """
    costs = []
    for a, left in enumerate(limbs):
        for b, right in enumerate(limbs):
            if a == b or not _is_left_right(left, right, at, names):
                continue
            left_length, right_length = _chain_length(left.chain, at), _chain_length(right.chain, at)
            differ = abs(left_length - right_length) / max(left_length, right_length, 1e-9)
            if differ < _MAX_PAIR_DIFFERENCE:
                costs.append(
                    (
                        differ
                        + 0.3 * _mirror_distance(left, right, at) / max(left_length, right_length, 1e-9),
                        a,
                        b,
                    )
                )
    pairs, used = list[Pair](), set[int]()
    for _, a, b in sorted(costs):
        if not {a, b} & used:
            used |= {a, b}
            pairs.append((limbs[a], limbs[b]))
    pairs.sort(key=lambda pair: -_pair_position(pair, at))
    return pairs, [limb for k, limb in enumerate(limbs) if k not in used]


def _is_left_right(left: SkeletonLimb, right: SkeletonLimb, at: Float, names: tuple[str, ...]) -> bool:
    """Returns True if the first limb is on the left and the second on the right, by name or position."""
    sides = [side_from_name(names[limb.chain[-1]]) for limb in (left, right)]
    if sides != [0, 0]:
        return sides == [1, -1]
    separation = float(at[list(left.chain), 0].mean() - at[list(right.chain), 0].mean())
    return separation > _MIN_PAIR_DISTANCE * max(
        _chain_length(left.chain, at), _chain_length(right.chain, at)
    )


def _mirror_distance(left: SkeletonLimb, right: SkeletonLimb, at: Float) -> float:
    """Returns the sum of the distances, metres, between both ends of a limb and the ends of the other limb's
    mirror image.
    """
    mirror = np.array([-1.0, 1.0, 1.0])
    start_distance = np.linalg.norm(at[left.chain[0]] * mirror - at[right.chain[0]])
    return float(start_distance + np.linalg.norm(np.array(left.end) * mirror - right.end))


def _pair_position(pair: Pair, at: Float) -> float:
    """Returns a sort key, metres, that increases with the forward and upward position of a pair's start. The
    positions of the ends distinguish pairs with equal starts.
    """
    starts = np.mean([at[limb.proper[0]] for limb in pair], axis=0)
    ends = np.mean([limb.end for limb in pair], axis=0)
    return float(starts[2] + starts[1] + 0.1 * (ends[2] + ends[1]))


def _head_and_tail(single: list[SkeletonLimb], at: Float) -> tuple[SkeletonLimb | None, SkeletonLimb | None]:
    """Finds the head and the tail among unpaired limbs. The head extends up and forward, and the tail
    backward.
    """
    directions = {limb: np.array(limb.end) - at[0] for limb in single}
    scored = sorted(single, key=lambda limb: float(directions[limb][1] + directions[limb][2]))
    head = scored[-1] if scored and directions[scored[-1]][1:].sum() > 0 else None
    backward_limbs = [limb for limb in scored if limb is not head and limb.end[2] < at[limb.chain[0], 2]]
    tail = backward_limbs[0] if backward_limbs else None
    return head, tail
