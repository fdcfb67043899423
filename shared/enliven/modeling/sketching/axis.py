"""The axis of an outline as a tree of chains, and its clean-up: removes zigzags, spurs and double
junctions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Int

TIP = 0.4
"""Distance in radii between the end of an axis and the tip of the outline."""
_MIN_SPUR_RADII = 2.4
"""Minimum length in radii of a limb in the outer corner of a bend. A corner without a limb also causes a
branch of the axis, but a shorter one.
"""
_MIN_LIMB_RADII = 1.3
"""Minimum length in radii of any other limb. A shorter branch barely protrudes from the shape around its
fork."""
_SHARP_BEND_SUM = 0.9
"""A bend is sharp (127 degrees or less) if the sum of its two unit directions is longer than this."""
_MERGE_DISTANCE_RADII = 0.9
"""Maximum distance of two junctions that are merged, as a multiple of the larger of their radii."""


@dataclass
class Axis:
    """The axis of an outline: a tree of points in the plane.

    Attributes:
        points: (A, 2) metres, the points of the axis.
        radii: (A,) metres, half the local width.
        chains: paths of points between ends and junctions, both included.
    """

    points: Float
    radii: Float
    chains: list[list[int]]


def smooth(points: Float, times: int = 3) -> Float:
    """Smooths a chain (P, 2) by ``times`` passes. The midpoints of chords zigzag between the two sides of the
    outline, and their running mean does not.
    """
    for _ in range(times):
        inner = 0.5 * points[1:-1] + 0.25 * (points[:-2] + points[2:])
        points = np.concatenate([points[:1], inner, points[-1:]])
    return points


def remove_spurs(axis: Axis) -> Axis:
    """Removes branches that are not limbs. A branch into the outer corner of a bend moves the joint there."""
    while True:
        ends = [end for chain in axis.chains for end in (chain[0], chain[-1])]
        degree = np.bincount(ends, minlength=len(axis.points))
        for spur in map(_chain_director(degree), axis.chains):
            if not spur:
                continue
            others = [c for c in axis.chains if spur[0] in (c[0], c[-1]) and set(c) != set(spur)]
            others = [c if c[0] == spur[0] else c[::-1] for c in others]
            bend = len(others) == 2 and _is_outside_bend(axis, spur, others[0], others[1])
            if _chain_length(axis, spur) < (_MIN_SPUR_RADII if bend else _MIN_LIMB_RADII) * _chain_radius(
                axis, spur
            ):
                break
        else:
            return axis
        rest = [c for c in axis.chains if spur[0] not in (c[0], c[-1])]
        if bend:
            others = _move_fork_to_corner(axis, spur, others)
        if len(others) == 2:
            others = [[*others[0][:0:-1], *others[1]]]
        axis.chains = rest + others


def _chain_length(axis: Axis, chain: list[int]) -> float:
    return float(np.linalg.norm(np.diff(axis.points[chain], axis=0), axis=1).sum())


def _chain_radius(axis: Axis, chain: list[int]) -> float:
    return float(np.median(axis.radii[chain[1:]]))


def _is_outside_bend(axis: Axis, spur: list[int], one: list[int], two: list[int]) -> bool:
    """Returns True if the branch ``spur`` is on the outer side of a sharp bend of two other branches. All
    three start at the fork."""
    directions = []
    for chain in (spur, one, two):
        away = axis.points[chain[1:]] - axis.points[spur[0]]
        far = np.linalg.norm(away, axis=1)
        index = (
            int(np.argmax(far > 2 * _chain_radius(axis, spur)))
            if (far > 2 * _chain_radius(axis, spur)).any()
            else -1
        )
        directions.append(away[index] / max(float(far[index]), 1e-300))
    bisector = directions[1] + directions[2]
    size = float(np.linalg.norm(bisector))
    return bool(size > _SHARP_BEND_SUM and directions[0] @ bisector < -0.5 * size)


def _move_fork_to_corner(axis: Axis, spur: list[int], others: list[list[int]]) -> list[list[int]]:
    """Moves the fork to the intersection of its two limbs, and removes nearby points from the limbs."""
    fork, width = spur[0], _chain_radius(axis, spur)
    back = axis.points[spur[-1]] - axis.points[spur[-2]]
    back /= max(float(np.linalg.norm(back)), 1e-300)
    # The spur ends 0.4 radii before the tip. The two limbs meet one radius before the tip.
    corner = axis.points[spur[-1]] - (1.0 - TIP) * width * back
    near = float(np.linalg.norm(axis.points[fork] - corner)) + 0.5 * width
    out = []
    for chain in others:
        inner = [i for i in chain[1:-1] if np.linalg.norm(axis.points[i] - corner) > near]
        out.append([fork, *inner, chain[-1]])
    axis.points[fork] = corner
    return out


def _chain_director(degree: Int) -> Callable[[list[int]], list[int]]:
    """Returns a function that directs a chain from its fork to its free end. For other chains it returns an
    empty list.
    """

    def turned(chain: list[int]) -> list[int]:
        if degree[chain[0]] >= 3 and degree[chain[-1]] == 1:
            return chain
        return chain[::-1] if degree[chain[-1]] >= 3 and degree[chain[0]] == 1 else []

    return turned


def merge_junctions(axis: Axis) -> Axis:
    """Contracts chains between two junctions that are shorter than ``_MERGE_DISTANCE_RADII``."""
    while True:
        ends = [end for chain in axis.chains for end in (chain[0], chain[-1])]
        degree = np.bincount(ends, minlength=len(axis.points))
        short = None
        for chain in axis.chains:
            a, b = chain[0], chain[-1]
            if a == b or degree[a] < 3 or degree[b] < 3:
                continue
            length = np.linalg.norm(np.diff(axis.points[chain], axis=0), axis=1).sum()
            if length < _MERGE_DISTANCE_RADII * max(axis.radii[a], axis.radii[b]) and (
                short is None or length < short[0]
            ):
                short = (length, chain)
        if short is None:
            return axis
        a, b = short[1][0], short[1][-1]
        radius_fraction = axis.radii[a] / (axis.radii[a] + axis.radii[b])
        axis.points[a] = radius_fraction * axis.points[a] + (1 - radius_fraction) * axis.points[b]
        axis.radii[a] = max(axis.radii[a], axis.radii[b])
        axis.chains = [[a if i == b else i for i in chain] for chain in axis.chains if chain is not short[1]]
