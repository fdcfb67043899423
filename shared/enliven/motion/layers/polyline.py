"""q(s, t): the rotation of a take, accumulated along a polyline of its skeleton (AniMesh, section 5.1).

    line = Polyline.of(clip, chain)           # the part that is constant over time
    line.knots                                # (K,) arc length s of the joints, 0..1
    knot_turns(...)                           # (T, K, 4) P at the knots, at frame numbers (fractions too)

Between two frames, the world rotations of the take are interpolated by slerp. All other rotations are derived
from these. So a polyline that is retargeted to itself reproduces the take exactly, at frames and between
them.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray, Float, Int32
from enliven.document import Clip, Skeleton
from enliven.errors import InputError
from enliven.kernels import njit
from enliven.motion.kinematics.quaternions import between, conj, load, mul, store

MIN_LENGTH_FRACTION = 1e-6
"""Minimum fraction of a polyline that a bone occupies. So even a bone of zero length gets an interval in
which its rotation is applied."""
_ZERO_LENGTH_FRACTION = 1e-9
"""Maximum length of a bone that counts as zero, as a fraction of the polyline."""


@dataclass(frozen=True, eq=False)
class Polyline:
    """A chain of a take's skeleton with its arc lengths, to be sampled at any frame.

    Attributes:
        clip: the take.
        chain: consecutive joints of the take's skeleton.
        knots: (K,) float64 arc length at the joints, from 0 to 1. A chain of one joint has knots 0 and 1.
        bones: (K - 1,) int32 the bone of the take that provides the rotation at knots 1, 2, ...
        base: the bone to which the other rotations are relative. It is the bone that ends at the first joint,
            or the root (0) for a chain that goes up the tree. -1 means that the rotations are in world axes.
    """

    clip: Clip
    chain: tuple[int, ...]
    knots: Float
    bones: Int32
    base: int

    @staticmethod
    def from_clip(clip: Clip, chain: Sequence[int]) -> Polyline:
        """Returns the polyline along ``chain``.

        Raises:
            InputError: if the joints do not exist or are not neighbours.
        """
        chain = tuple(int(joint) for joint in chain)
        bones = bones_along(clip.skeleton, chain, where=f"take {clip.id!r}")
        if len(chain) == 1:
            return Polyline(clip, chain, np.array([0.0, 1.0]), np.array(chain, np.int32), -1)
        base = chain[0] if is_downward(clip.skeleton, chain) else 0
        return Polyline(clip, chain, arc_lengths(clip.skeleton, chain), np.array(bones, np.int32), base)


def bones_along(skeleton: Skeleton, chain: Sequence[int], where: str) -> list[int]:
    """Returns the bone between each two successive joints of a chain.

    Raises:
        InputError: if a joint does not exist, occurs twice, or is not a neighbour of the previous joint.
    """
    if not chain:
        raise InputError("the chain has no joint", where=where, remedy="Pass at least one joint.")
    for joint in chain:
        if not 0 <= joint < len(skeleton):
            raise InputError(
                f"joint {joint} does not exist; the skeleton has {len(skeleton)} joints", where=where
            )
    if len(set(chain)) != len(chain):
        raise InputError("the chain contains a joint twice", where=where, remedy="List each joint once.")
    bones = []
    for a, b in itertools.pairwise(chain):
        if skeleton.parents[b] == a:
            bones.append(b)
        elif skeleton.parents[a] == b:
            bones.append(a)
        else:
            problem = f"joints {skeleton.names[a]!r} and {skeleton.names[b]!r} are not neighbours"
            raise InputError(
                problem,
                where=where,
                remedy="Pass all joints between the two ends. Skeleton.path returns them.",
            )
    return bones


def is_downward(skeleton: Skeleton, chain: Sequence[int]) -> bool:
    """Returns True if every joint of the chain is a child of the previous one."""
    return all(skeleton.parents[b] == a for a, b in itertools.pairwise(chain))


def arc_lengths(skeleton: Skeleton, chain: Sequence[int]) -> Float:
    """Returns the arc length (K,) at the joints of a chain at rest, from 0 to 1. A bone of zero length gets a
    small interval.
    """
    lengths = np.linalg.norm(np.diff(skeleton.positions[list(chain)], axis=0), axis=1)
    total = lengths.sum()
    none = lengths <= _ZERO_LENGTH_FRACTION * total
    lengths = np.where(none, MIN_LENGTH_FRACTION * total, lengths) if total > 0 else np.ones(len(lengths))
    arc = np.concatenate([[0.0], np.cumsum(lengths)])
    return np.asarray(arc / arc[-1] if arc[-1] > 0 else arc)


def locate_on_knots(knots: Float, s: AnyArray) -> tuple[Int32, Float]:
    """Returns the knot (S,) at or before each ``s`` (S,), and the fraction (S,) in [0, 1] of the way to
    the next.
    """
    s = np.clip(np.asarray(s, np.float64), 0.0, 1.0)
    knot = np.clip(np.searchsorted(knots, s, side="right") - 1, 0, len(knots) - 2)
    width = knots[knot + 1] - knots[knot]
    fraction = np.where(width > 0.0, (s - knots[knot]) / np.where(width > 0.0, width, 1.0), 0.0)
    return knot.astype(np.int32), np.clip(fraction, 0.0, 1.0)


@njit(cache=True, nogil=True)
def knot_turns(turns, bones, first, bases, at, weights, basis, mirrored, begin, out):
    """Computes the rotations basis P basis^-1 at the knots of L polylines of one take. Writes them to
    ``out`` (T, K, 4), starting at knot ``begin``.

    Each polyline has the identity and then one rotation for each of its bones.

    Args:
        turns: (F, N, 4) world rotations of the take.
        bones: (B,) bones of all polylines. The bones of polyline i are at indices ``first[i]`` to
            ``first[i + 1]``.
        bases: (L,) the bone to which each polyline is relative, or -1.
        at: (T, L) frame numbers.
        weights: (T, L) weights of the layers.
        basis: (L, 4) bases of the layers.
        mirrored: (L,) True for mirrored layers.
    """
    for t in range(len(at)):
        knot = begin
        for i in range(len(bases)):
            frame = max(min(int(at[t, i]), len(turns) - 2), 0)
            part = min(max(at[t, i] - frame, 0.0), 1.0)
            row_turns(
                turns,
                bones[first[i] : first[i + 1]],
                bases[i],
                frame,
                part,
                weights[t, i],
                basis[i],
                mirrored[i],
                out[t, knot:],
            )
            knot += first[i + 1] - first[i] + 1


@njit(cache=True, nogil=True)
def row_turns(turns, bones, base, frame, part, weight, basis, mirrored, out):
    """Computes the rotations ``out`` (K, 4) at the knots of one polyline, at the fraction ``part`` from
    ``frame`` to the next frame."""
    identity = (1.0, 0.0, 0.0, 0.0)
    turned = (basis[0], basis[1], basis[2], basis[3])
    plain = turned[1] == 0.0 and turned[2] == 0.0 and turned[3] == 0.0
    start = conj(turn_at(turns, frame, part, base)) if base >= 0 else identity
    total, last, before = identity, identity, identity
    store(out, 0, identity)
    for k in range(len(bones)):
        full_turn = mul(start, turn_at(turns, frame, part, bones[k]))
        if weight == 1.0:
            total = full_turn
        else:
            total = mul(total, between(identity, mul(conj(last), full_turn), weight))
            last = full_turn
        knot = total
        if mirrored:
            knot = (knot[0], knot[1], -knot[2], -knot[3])
        if not plain:
            knot = mul(mul(turned, knot), conj(turned))
        if knot[0] * before[0] + knot[1] * before[1] + knot[2] * before[2] + knot[3] * before[3] < 0.0:
            knot = (-knot[0], -knot[1], -knot[2], -knot[3])
        store(out, k + 1, knot)
        before = knot


@njit(cache=True, nogil=True)
def blend_knots(others, share, weight, first, begin, out):
    """Blends the rotations ``out`` (T, K, 4) at the knots of L polylines by ``share`` (T, L) towards
    ``others``, and applies ``weight`` (T, L).

    ``first`` and ``begin`` have the same meaning as in :func:`knot_turns`.
    """
    identity = (1.0, 0.0, 0.0, 0.0)
    for t in range(len(out)):
        for i in range(share.shape[1]):
            if share[t, i] == 0.0 and weight[t, i] == 1.0:
                continue
            for k in range(begin + first[i] + i, begin + first[i + 1] + i + 1):
                mixed = between(load(out[t], k), load(others[t], k), share[t, i])
                store(out[t], k, between(identity, mixed, weight[t, i]))


@njit(cache=True, nogil=True)
def turn_at(turns, frame, part, entry):
    """Returns the rotation of bone ``entry`` of ``turns`` (F, N, 4), at the fraction ``part`` from ``frame``
    to the next frame.
    """
    if part == 0.0:
        return load(turns[frame], entry)
    return between(load(turns[frame], entry), load(turns[frame + 1], entry), part)
