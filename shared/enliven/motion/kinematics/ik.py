"""Compiled inverse kinematics (IK) of a limb of two bones, in closed form.

It changes the current rotations as little as possible, so that a smooth motion stays smooth. If the goal is
too far away, the limb is extended towards it. If the goal is too near, the limb is folded.
"""

from __future__ import annotations

import math

from enliven.kernels import njit
from enliven.motion.kinematics.quaternions import mul, turn
from enliven.motion.kinematics.vectors import (
    cross,
    dot,
    length,
    perpendicular_unit,
    rotation_about,
    subtract,
    swing_to,
)

_NEARLY_STRAIGHT_SINE = 0.15
"""Maximum sine of the bend angle of a nearly straight limb."""


@njit(cache=True, nogil=True)
def two_bone(start, middle, end, goal, side):
    """Computes the rotations of the upper part (about ``start``) and of the lower part (about ``middle``)
    that move the end to ``goal``.

    First the bend at the middle is set by the law of cosines, then the whole limb swings to the goal. A
    clearly bent limb stays in its plane. A nearly straight limb has no well-defined plane (a knee may even be
    bent backwards slightly), so its middle joint is moved towards ``side``.

    Args:
        side: triple, the direction in which the middle joint bulges at rest.

    Returns:
        Two quaternions in world axes. Multiply them from the left with the current rotations of the parts.
    """
    u, v = subtract(start, middle), subtract(end, middle)
    a, b = length(u), length(v)
    if a < 1e-12 or b < 1e-12:
        whole = swing_to(subtract(end, start), subtract(goal, start))
        return whole, whole
    d = min(max(length(subtract(goal, start)), abs(a - b)), a + b)
    plane = cross(u, v)
    sine = length(plane) / (a * b)
    now = math.atan2(sine, dot(u, v) / (a * b))
    half = (d * d - (a - b) * (a - b)) / (4.0 * a * b)
    wanted = 2.0 * math.asin(math.sqrt(min(max(half, 0.0), 1.0)))
    n = bend_axis(u, plane, sine, max(now - wanted, 0.0), side)
    q = rotation_about(n, wanted)
    scale = b / a
    bent = turn(q, u[0] * scale, u[1] * scale, u[2] * scale)
    bend = swing_to(v, bent)
    reached = (middle[0] + bent[0], middle[1] + bent[1], middle[2] + bent[2])
    whole = swing_to(subtract(reached, start), subtract(goal, start))
    return whole, mul(whole, bend)


@njit(cache=True, nogil=True)
def bend_axis(u, plane, sine, more, side):
    """Returns the unit axis, perpendicular to ``u`` (middle to start), about which a limb is bent.

    Args:
        plane: triple along the axis of the current bend.
        sine: the sine of the current bend angle.
        more: additional bend angle, radians.
        side: triple, the direction in which the limb bulges at rest.
    """
    wish = cross(u, (-side[0], -side[1], -side[2]))
    size = length(wish)
    if size > 1e-9 * length(u) * max(length(side), 1e-300):
        wish = (wish[0] / size, wish[1] / size, wish[2] / size)
    else:
        wish = perpendicular_unit(u)
    whole = length(plane)
    if whole < 1e-300:
        return wish
    lean = math.exp(-((sine / _NEARLY_STRAIGHT_SINE) ** 2))
    own, drawn = (sine + (1.0 - lean) * more) / whole, lean * more
    n = (
        own * plane[0] + drawn * wish[0],
        own * plane[1] + drawn * wish[1],
        own * plane[2] + drawn * wish[2],
    )
    size = length(n)
    return (n[0] / size, n[1] / size, n[2] / size) if size > 1e-12 else wish
