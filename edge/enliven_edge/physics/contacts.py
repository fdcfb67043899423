"""Corrects the engine's contacts before the solver runs.

Moving spheres then push objects, and no object is flung away.

MuJoCo moves a mocap body by setting its position. The solver treats it as static, so a fast sphere pushes
only by penetration depth: at 3 m/s it enters a box by 6 cm, at 10 m/s it passes through. The reference
acceleration of a contact row is aref = -b v - k d r (MuJoCo, "Computation", constraint model). Here v is the
relative velocity of the bodies that the solver knows. This module adds the term of the sphere's velocity,
which is missing in v. A body of great mass with the same velocity would give the same result (measured, and
tested), but it would add degrees of freedom.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit

FLOOR = -2
"""Value in place of a sphere's index that means the floor."""
NOTHING = -1
"""Value in place of a sphere's index that means "no contact"."""
_MAX_REST_SPEED = 0.5
"""Maximum speed of contacts that do not bounce, in metres per second. Without it, balls would not come to
rest."""
_DAMPED_SPEED = 0.02
"""Linear speed below which a prop is damped, in metres per second."""
_DAMPED_TURN_RATE = 0.1
"""Angular speed below which a prop is damped, in radians per second."""
_DAMPING = 0.5
"""Fraction of its velocity that a damped prop keeps per step."""


@njit(cache=True, nogil=True)
def correct_contacts(
    geoms,
    frames,
    distances,
    addresses,
    dims,
    reference,
    impedance,
    approach,
    owner,
    velocities,
    bounce,
    push_out,
    step,
    touched,
):
    """Adds the spheres' velocities to the contacts' reference acceleration, and limits the depenetration
    speed.

    The reference also makes balls bounce: in the step of the impact, it changes the speed -v to e v with the
    restitution e. (The engine's own springy contact would fling away a ball that was penetrated deeply.)

    Args:
        geoms: (C, 2) geoms of each contact. Its normal points from the first to the second.
        frames: (C, 9) normal and two tangents, rows.
        distances: (C,) metres, negative if two objects penetrate.
        addresses: (C,) first row of the contact, -1 if it has none.
        dims: (C,) number of rows of the contact.
        reference: (R,) the rows' reference acceleration, changed in place.
        impedance: (R, 4) stiffness, damping, impedance and its slope of each row.
        approach: (R,) the rows' velocity without that of the spheres, changed in place.
        owner: (G,) owner of each geom: k for sphere k, -3 - p for prop p, FLOOR for the floor.
        velocities: (S, 3) velocities of the spheres, metres per second.
        bounce: (P,) restitution: speed after a bounce divided by the speed before.
        push_out: metres per second, maximum depenetration speed.
        step: seconds.
        touched: (P,) changed in place: the sphere that a prop touches, FLOOR, or the previous value.
    """
    for c in range(distances.shape[0]):
        row = addresses[c]
        if row < 0:
            continue
        first, second = owner[geoms[c, 0]], owner[geoms[c, 1]]
        stiffness, damping, share = impedance[row, 0], impedance[row, 1], impedance[row, 2]
        if stiffness > 0.0:
            # Compute the depth at which stiffness and damping balance at the maximum depenetration speed.
            deepest = push_out * damping / (stiffness * share)
            if distances[c] < -deepest:
                reference[row] += stiffness * share * (distances[c] + deepest)
        # Record which sphere or floor a prop touches, and add the velocity of the sphere to the contact rows.
        for side in range(2):
            mine, other = (first, second) if side == 0 else (second, first)
            if other <= -3 and mine > -3 and (mine >= 0 or touched[-3 - other] == NOTHING):
                touched[-3 - other] = mine
            if mine < 0:
                continue
            # The relative velocity of a contact is the velocity of its second body minus that of its first.
            sign = 1.0 if side == 0 else -1.0
            for r in range(min(dims[c], 3)):
                along = 0.0
                for a in range(3):
                    along += frames[c, 3 * r + a] * velocities[mine, a]
                reference[row + r] += sign * impedance[row + r, 1] * along
                approach[row + r] -= sign * along
        # Bounce: raise the normal row's reference, so that the approach speed v becomes -e v in one step.
        springy = 0.0
        for who in (first, second):
            if who <= -3:
                springy = max(springy, bounce[-3 - who])
        if springy > 0.0 and approach[row] < -_MAX_REST_SPEED:
            reference[row] = max(reference[row], -(1.0 + springy) * approach[row] / step)


@njit(cache=True, nogil=True)
def limit_speeds(velocities, fastest, fastest_turn):
    """Limits the rows of (P, 6) linear and angular velocities. Returns False if one is not finite.

    Slow rows are damped as well. Gravity is far stronger than the damping, so nothing hovers. Without
    damping, contacts that appear and disappear would make a tower tremble for ever, by a tenth of a
    millimetre.
    """
    for p in range(velocities.shape[0]):
        moving = velocities[p, 0] ** 2 + velocities[p, 1] ** 2 + velocities[p, 2] ** 2
        turning = velocities[p, 3] ** 2 + velocities[p, 4] ** 2 + velocities[p, 5] ** 2
        if moving < _DAMPED_SPEED * _DAMPED_SPEED and turning < _DAMPED_TURN_RATE * _DAMPED_TURN_RATE:
            for a in range(6):
                velocities[p, a] *= _DAMPING
        for part, most in ((0, fastest), (3, fastest_turn)):
            square = 0.0
            for a in range(part, part + 3):
                square += velocities[p, a] ** 2
            if not np.isfinite(square):
                return False
            if square > most * most:
                for a in range(part, part + 3):
                    velocities[p, a] *= most / np.sqrt(square)
    return True
