"""Compiled inverse kinematics (IK) of a chain of any number of bones: FABRIK (Aristidou & Lasenby 2011), with
an exact final step.

FABRIK's iterations spread the bend over the chain. Then the two halves of the chain are treated as rigid
bones, and the end is moved exactly to the goal in closed form. If the goal is out of reach, the end is moved
as near to it as possible.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven.motion.kinematics.ik import two_bone
from enliven.motion.kinematics.quaternions import between, conj, load, mul, store, turn
from enliven.motion.kinematics.vectors import length, row, subtract, swing_to

_FABRIK_ITERATIONS = 8
"""Number of FABRIK iterations. They only spread the bend over the chain. The closed form then reaches the
goal exactly."""
_MAX_REPETITIONS = 4
"""Maximum number of repetitions. More than one is needed if the goal is so near that the closed form cannot
reach it with the current halves."""


@njit(cache=True, nogil=True)
def reach_goal(points, goal, side, turns):
    """Moves the end of a chain of points (K, 3) to ``goal``. Bones keep their lengths, and the first
    point stays in place.

    Args:
        points: (K, 3) metres, changed in place.
        goal: triple, metres.
        side: triple, the direction in which a straight chain bends.
        turns: (K - 1, 4) output: the shortest rotation of each bone from its old to its new direction.
    """
    count = len(points)
    before = points.copy()
    first = row(points, 0)
    sizes = np.empty(count - 1)
    for i in range(count - 1):
        sizes[i] = length(subtract(row(points, i + 1), row(points, i)))
    whole, far = sizes.sum(), length(subtract(goal, first))
    if far >= whole or count == 2:
        straighten(points, goal, sizes)
    elif count == 3:
        rotate_end_to_goal(points, goal, side)
    else:
        for _ in range(_MAX_REPETITIONS):
            run_fabrik(points, goal, sizes)
            rotate_end_to_goal(points, goal, side)
            if length(subtract(row(points, count - 1), goal)) < 1e-9 * whole:
                break
        if length(subtract(row(points, count - 1), first)) < far * (1.0 - 1e-9):
            unbend(points, goal, far, sizes)
    for i in range(count - 1):
        old, new = subtract(row(before, i + 1), row(before, i)), subtract(row(points, i + 1), row(points, i))
        store(turns, i, swing_to(old, new))


@njit(cache=True, nogil=True)
def straighten(points, goal, sizes):
    """Straightens a chain (K, 3) with bone lengths ``sizes`` (K - 1,) towards the goal."""
    way = subtract(goal, row(points, 0))
    far = length(way)
    if far < 1e-12:
        return
    for i in range(len(sizes)):
        for axis in range(3):
            points[i + 1, axis] = points[i, axis] + way[axis] * (sizes[i] / far)


@njit(cache=True, nogil=True)
def run_fabrik(points, goal, sizes):
    """Runs FABRIK iterations on points (K, 3): backwards from the goal, then forwards from the first
    point.
    """
    count = len(points)
    first = row(points, 0)
    for _ in range(_FABRIK_ITERATIONS):
        points[count - 1, 0], points[count - 1, 1], points[count - 1, 2] = goal
        for i in range(count - 2, -1, -1):
            place_at_distance(points, i + 1, i, sizes[i])
        points[0, 0], points[0, 1], points[0, 2] = first
        for i in range(count - 1):
            place_at_distance(points, i, i + 1, sizes[i])


@njit(cache=True, nogil=True)
def unbend(points, goal, far, sizes):
    """Reduces every bend of a chain (K, 3) by the same fraction until the distance between its ends is
    ``far``.

    Then rotates the chain towards the goal. The function is used if the halves are too bent to reach the
    goal.
    """
    count = len(points)
    bends, unbent = np.empty((count - 1, 4)), points.copy()
    for i in range(count - 2):
        a, b = subtract(row(points, i + 1), row(points, i)), subtract(row(points, i + 2), row(points, i + 1))
        store(bends, i + 1, swing_to(a, b))
    low, high = 0.0, 1.0
    for _ in range(50):
        part = (low + high) / 2
        link = subtract(row(points, 1), row(points, 0))
        scale = 1.0 / max(length(link), 1e-300)
        link = (link[0] * scale, link[1] * scale, link[2] * scale)
        for i in range(count - 1):
            if i > 0:
                # Apply a fraction of the bend. The bones before this bone were already rotated, and they
                # rotate this bone too.
                q = between((1.0, 0.0, 0.0, 0.0), load(bends, i), part)
                old = subtract(row(points, i), row(points, i - 1))
                q = mul(mul(swing_to(old, link), q), conj(swing_to(old, link)))
                link = turn(q, link[0], link[1], link[2])
            for axis in range(3):
                unbent[i + 1, axis] = unbent[i, axis] + sizes[i] * link[axis]
        if length(subtract(row(unbent, count - 1), row(unbent, 0))) < far:
            high = part
        else:
            low = part
    q = swing_to(subtract(row(unbent, count - 1), row(unbent, 0)), subtract(goal, row(unbent, 0)))
    for i in range(1, count):
        way = subtract(row(unbent, i), row(unbent, 0))
        x, y, z = turn(q, way[0], way[1], way[2])
        points[i, 0], points[i, 1], points[i, 2] = points[0, 0] + x, points[0, 1] + y, points[0, 2] + z


@njit(cache=True, nogil=True)
def place_at_distance(points, fixed, moved, size):
    """Moves point ``moved`` to distance ``size`` from point ``fixed``, keeping its direction."""
    way = subtract(row(points, moved), row(points, fixed))
    far = length(way)
    if far < 1e-12:
        return
    for axis in range(3):
        points[moved, axis] = points[fixed, axis] + way[axis] * (size / far)


@njit(cache=True, nogil=True)
def rotate_end_to_goal(points, goal, side):
    """Moves the end of the points (K, 3) to the goal in closed form, by rotating the two halves like two
    rigid bones."""
    count = len(points)
    middle = count // 2
    upper, lower = two_bone(row(points, 0), row(points, middle), row(points, count - 1), goal, side)
    before = points.copy()
    for i in range(1, count):
        origin = 0 if i <= middle else middle
        q = upper if i <= middle else lower
        way = subtract(row(before, i), row(before, origin))
        x, y, z = turn(q, way[0], way[1], way[2])
        points[i, 0] = points[origin, 0] + x
        points[i, 1] = points[origin, 1] + y
        points[i, 2] = points[origin, 2] + z
