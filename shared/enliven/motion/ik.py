"""Compiled inverse kinematics: two bones in closed form, chains of many by FABRIK (Aristidou & Lasenby 2011).

Both turn what is there as little as they can, so that what follows a motion stays a motion. A goal out of
reach is met as nearly as the limb allows: stretched towards it, or folded.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from enliven.motion.quaternions import between, conj, load, mul, store, turn

_ROUNDS = 8
"""FABRIK rounds: they spread the bend over the chain; the closed form then makes it exact."""
_STRAIGHT = 0.15
"""Sine of the bend about which a limb counts as straight."""
_TRIES = 4
"""How often that is done where one half alone cannot be folded enough."""


@njit(cache=True, nogil=True)
def minus(a, b):  # type: ignore[no-untyped-def]
    """Kernel: a - b of triples."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(cache=True, nogil=True)
def cross(a, b):  # type: ignore[no-untyped-def]
    """Kernel: a x b of triples."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, nogil=True)
def dot(a, b):  # type: ignore[no-untyped-def]
    """Kernel: a . b of triples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True)
def length(a):  # type: ignore[no-untyped-def]
    """Kernel: |a| of a triple."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@njit(cache=True, nogil=True)
def at_right_angles(a):  # type: ignore[no-untyped-def]
    """Kernel: some unit vector at right angles to ``a``, that depends on ``a`` alone."""
    x, y, z = abs(a[0]), abs(a[1]), abs(a[2])
    axis = (1.0, 0.0, 0.0)
    if y <= x and y <= z:
        axis = (0.0, 1.0, 0.0)
    elif z <= x and z <= y:
        axis = (0.0, 0.0, 1.0)
    n = cross(a, axis)
    size = length(n)
    if size == 0.0:
        return 1.0, 0.0, 0.0
    return n[0] / size, n[1] / size, n[2] / size


@njit(cache=True, nogil=True)
def about(n, angle):  # type: ignore[no-untyped-def]
    """Kernel: the quaternion of a turn about the unit ``n`` by ``angle``."""
    s = math.sin(angle / 2)
    return math.cos(angle / 2), n[0] * s, n[1] * s, n[2] * s


@njit(cache=True, nogil=True)
def swing_to(a, b):  # type: ignore[no-untyped-def]
    """Kernel: the shortest turn from the direction of ``a`` to that of ``b``; none if one has no length."""
    size, other = length(a), length(b)
    if size < 1e-12 or other < 1e-12:
        return 1.0, 0.0, 0.0, 0.0
    n = cross(a, b)
    sine = length(n)
    if sine < 1e-14 * size * other:
        if dot(a, b) > 0.0:
            return 1.0, 0.0, 0.0, 0.0
        n = at_right_angles(a)
        return 0.0, n[0], n[1], n[2]
    return about((n[0] / sine, n[1] / sine, n[2] / sine), math.atan2(sine, dot(a, b)))


@njit(cache=True, nogil=True)
def two_bone(start, middle, end, goal, side):  # type: ignore[no-untyped-def]
    """Kernel: turns of the upper part (about ``start``) and of the lower (about ``middle``) that bring the
    end to ``goal``: first the bend at the middle by the law of cosines, then the swing of the whole.

    A limb that is clearly bent stays in its plane. One that is nearly straight has none to speak of (a knee
    may even lean backwards by a hair): what it is bent more, it is bent towards ``side``.

    Args:
        side: triple, where the middle bulges to at rest.

    Returns:
        Two quaternions, to be applied in the world before (on the left of) what the parts turned.
    """
    u, v = minus(start, middle), minus(end, middle)
    a, b = length(u), length(v)
    if a < 1e-12 or b < 1e-12:
        whole = swing_to(minus(end, start), minus(goal, start))
        return whole, whole
    d = min(max(length(minus(goal, start)), abs(a - b)), a + b)
    plane = cross(u, v)
    sine = length(plane) / (a * b)
    now = math.atan2(sine, dot(u, v) / (a * b))
    half = (d * d - (a - b) * (a - b)) / (4.0 * a * b)
    wanted = 2.0 * math.asin(math.sqrt(min(max(half, 0.0), 1.0)))
    n = bend_axis(u, plane, sine, max(now - wanted, 0.0), side)
    q = about(n, wanted)
    scale = b / a
    bent = turn(q, u[0] * scale, u[1] * scale, u[2] * scale)
    bend = swing_to(v, bent)
    reached = (middle[0] + bent[0], middle[1] + bent[1], middle[2] + bent[2])
    whole = swing_to(minus(reached, start), minus(goal, start))
    return whole, mul(whole, bend)


@njit(cache=True, nogil=True)
def bend_axis(u, plane, sine, more, side):  # type: ignore[no-untyped-def]
    """Kernel: the unit axis, at right angles to ``u`` (middle to start), about which a limb is bent.

    Args:
        plane: triple along the axis of the bend that it has, whose ``sine`` is known.
        more: radians that it is to be bent more.
        side: triple, where it bulges at rest.
    """
    wish = cross(u, (-side[0], -side[1], -side[2]))
    size = length(wish)
    if size > 1e-9 * length(u) * max(length(side), 1e-300):
        wish = (wish[0] / size, wish[1] / size, wish[2] / size)
    else:
        wish = at_right_angles(u)
    whole = length(plane)
    if whole < 1e-300:
        return wish
    lean = math.exp(-((sine / _STRAIGHT) ** 2))
    own, drawn = (sine + (1.0 - lean) * more) / whole, lean * more
    n = (
        own * plane[0] + drawn * wish[0],
        own * plane[1] + drawn * wish[1],
        own * plane[2] + drawn * wish[2],
    )
    size = length(n)
    return (n[0] / size, n[1] / size, n[2] / size) if size > 1e-12 else wish


@njit(cache=True, nogil=True)
def reach(points, goal, side, turns):  # type: ignore[no-untyped-def]
    """Kernel: moves the end of a chain of points (K, 3) to ``goal``; bones keep their length, the first
    point stays.

    Args:
        points: (K, 3) metres; they are moved.
        goal: triple, metres.
        side: triple, where a straight chain bulges to.
        turns: (K - 1, 4) takes the turn of each bone since before, the shortest.
    """
    count = len(points)
    before = points.copy()
    first = row(points, 0)
    sizes = np.empty(count - 1)
    for i in range(count - 1):
        sizes[i] = length(minus(row(points, i + 1), row(points, i)))
    whole, far = sizes.sum(), length(minus(goal, first))
    if far >= whole or count == 2:
        straighten(points, goal, sizes)
    elif count == 3:
        settle(points, goal, side)
    else:
        for _ in range(_TRIES):
            spread(points, goal, sizes)
            settle(points, goal, side)
            if length(minus(row(points, count - 1), goal)) < 1e-9 * whole:
                break
        if length(minus(row(points, count - 1), first)) < far * (1.0 - 1e-9):
            unbend(points, goal, far, sizes)
    for i in range(count - 1):
        old, new = minus(row(before, i + 1), row(before, i)), minus(row(points, i + 1), row(points, i))
        store(turns, i, swing_to(old, new))


@njit(cache=True, nogil=True)
def straighten(points, goal, sizes):  # type: ignore[no-untyped-def]
    """Kernel: lays a chain (K, 3) of ``sizes`` (K - 1,) straight towards the goal."""
    way = minus(goal, row(points, 0))
    far = length(way)
    if far < 1e-12:
        return
    for i in range(len(sizes)):
        for axis in range(3):
            points[i + 1, axis] = points[i, axis] + way[axis] * (sizes[i] / far)


@njit(cache=True, nogil=True)
def spread(points, goal, sizes):  # type: ignore[no-untyped-def]
    """Kernel: FABRIK rounds, backwards from the goal and forwards from the first point (K, 3)."""
    count = len(points)
    first = row(points, 0)
    for _ in range(_ROUNDS):
        points[count - 1, 0], points[count - 1, 1], points[count - 1, 2] = goal
        for i in range(count - 2, -1, -1):
            pulled(points, i + 1, i, sizes[i])
        points[0, 0], points[0, 1], points[0, 2] = first
        for i in range(count - 1):
            pulled(points, i, i + 1, sizes[i])


@njit(cache=True, nogil=True)
def unbend(points, goal, far, sizes):  # type: ignore[no-untyped-def]
    """Kernel: takes so much off every bend of a chain (K, 3) that its end is ``far`` from its start, and
    points it at the goal: what is left to do where the halves are too bent to reach."""
    count = len(points)
    bends, made = np.empty((count - 1, 4)), points.copy()
    for i in range(count - 2):
        a, b = minus(row(points, i + 1), row(points, i)), minus(row(points, i + 2), row(points, i + 1))
        store(bends, i + 1, swing_to(a, b))
    low, high = 0.0, 1.0
    for _ in range(50):
        part = (low + high) / 2
        link = minus(row(points, 1), row(points, 0))
        scale = 1.0 / max(length(link), 1e-300)
        link = (link[0] * scale, link[1] * scale, link[2] * scale)
        for i in range(count - 1):
            if i > 0:
                # The bend as the less bent bones before it carry it, and only a part of it.
                q = between((1.0, 0.0, 0.0, 0.0), load(bends, i), part)
                old = minus(row(points, i), row(points, i - 1))
                q = mul(mul(swing_to(old, link), q), conj(swing_to(old, link)))
                link = turn(q, link[0], link[1], link[2])
            for axis in range(3):
                made[i + 1, axis] = made[i, axis] + sizes[i] * link[axis]
        if length(minus(row(made, count - 1), row(made, 0))) < far:
            high = part
        else:
            low = part
    q = swing_to(minus(row(made, count - 1), row(made, 0)), minus(goal, row(made, 0)))
    for i in range(1, count):
        way = minus(row(made, i), row(made, 0))
        x, y, z = turn(q, way[0], way[1], way[2])
        points[i, 0], points[i, 1], points[i, 2] = points[0, 0] + x, points[0, 1] + y, points[0, 2] + z


@njit(cache=True, nogil=True)
def row(points, i):  # type: ignore[no-untyped-def]
    """Kernel: row ``i`` of (K, 3) as a triple."""
    return points[i, 0], points[i, 1], points[i, 2]


@njit(cache=True, nogil=True)
def pulled(points, fixed, moved, size):  # type: ignore[no-untyped-def]
    """Kernel: puts point ``moved`` at ``size`` from point ``fixed``, in the direction that it has."""
    way = minus(row(points, moved), row(points, fixed))
    far = length(way)
    if far < 1e-12:
        return
    for axis in range(3):
        points[moved, axis] = points[fixed, axis] + way[axis] * (size / far)


@njit(cache=True, nogil=True)
def settle(points, goal, side):  # type: ignore[no-untyped-def]
    """Kernel: makes the end of (K, 3) meet the goal: the two halves, each rigid, as two bones."""
    count = len(points)
    middle = count // 2
    upper, lower = two_bone(row(points, 0), row(points, middle), row(points, count - 1), goal, side)
    before = points.copy()
    for i in range(1, count):
        origin = 0 if i <= middle else middle
        q = upper if i <= middle else lower
        way = minus(row(before, i), row(before, origin))
        x, y, z = turn(q, way[0], way[1], way[2])
        points[i, 0] = points[origin, 0] + x
        points[i, 1] = points[origin, 1] + y
        points[i, 2] = points[origin, 2] + z
