"""Chooses the points of a character that motion trails are drawn for: the selected points, or the ends of its
limbs.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import ExampleCharacter, RigBase

_MAX_TRAILS = 7
"""Maximum number of trails without a selection: for two hands, two feet, a head and two ears."""
_MIN_END_DISTANCE = 0.12
"""Minimum distance between two limb ends, as a fraction of the character's size. So the fingers of a hand
count as one end.
"""


def choose_trail_points(
    character: RigBase, rest: Float, chosen: int | None, chain: tuple[int, ...]
) -> tuple[int, ...]:
    """Returns the indices of the points with a trail: the selected points, or the ends of the limbs.

    Args:
        rest: (N, 3) metres, the character's points at one time: joints, nodes or control points.
        chosen: the selected point, or None.
        chain: the selected chain of points. Its last point gets a trail.
    """
    wanted_points = [point for point in (chosen, *chain[-1:]) if point is not None and point < len(rest)]
    if wanted_points:
        return tuple(dict.fromkeys(wanted_points))
    if isinstance(character, ExampleCharacter):
        return tuple(range(min(len(rest), 2 * _MAX_TRAILS)))
    parents = character.parents
    if not len(parents):
        return find_far_ends(rest, np.arange(len(rest)), rest.mean(0))
    leaves = np.setdiff1d(np.arange(len(rest)), parents)
    return find_far_ends(rest, leaves, rest[0])


def find_far_ends(points: Float, candidates: AnyArray, start: Float) -> tuple[int, ...]:
    """Returns the indices of the candidates among points (N, 3) that are far from ``start`` (3,) and from
    each other, in ascending order.
    """
    candidates = np.asarray(candidates, np.int64)
    if not len(candidates):
        return ()
    ends = list[int]()
    size = float(np.linalg.norm(points.max(0) - points.min(0)))
    distances = np.linalg.norm(points[candidates] - start, axis=1)
    for _ in range(_MAX_TRAILS):
        best = int(distances.argmax())
        if distances[best] < _MIN_END_DISTANCE * size and ends:
            break
        ends.append(int(candidates[best]))
        distances = np.minimum(distances, np.linalg.norm(points[candidates] - points[ends[-1]], axis=1))
    return tuple(sorted(ends))
