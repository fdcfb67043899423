"""Corrects the engine's contacts before it solves them: moving spheres push, and nothing is flung.

MuJoCo moves a mocap body by setting its place; for the solver it stands still, so a fast sphere pushes by
its depth alone: at 3 m/s a box is entered 6 cm deep, at 10 m/s passed through. The reference acceleration of
a contact row is aref = -b v - k d r (MuJoCo, "Computation", constraint model) with the relative velocity v of
the bodies that the solver knows. The term of the sphere's own velocity is added here. The result is that of a
body of great mass and of the same velocity (measured, and tested), but costs no degrees of freedom.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit

FLOOR = -2
"""In place of a sphere's number: the floor."""
NOTHING = -1
"""In place of a sphere's number: no contact."""
_SLOW = 0.5
"""Metres a second: slower contacts do not bounce, so that balls come to rest."""
_CALM = 0.02
"""Metres a second below which a prop is braked."""
_CALM_TURN = 0.1
"""Radians a second below which a prop is braked."""
_BRAKE = 0.5
"""Share of its velocity that a braked prop keeps at each step."""


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
    """Adds the spheres' velocities to the contacts' reference, and bounds the speed at which depth is undone.

    Balls bounce here too: in the one step in which they meet something the reference is what turns the
    speed -v into e v. (The engine's own springy contact would fling a ball that was entered deeply.)

    Args:
        geoms: (C, 2) geoms of each contact; its normal runs from the first to the second.
        frames: (C, 9) normal and two tangents, rows.
        distances: (C,) metres, negative where two things are inside each other.
        addresses: (C,) first row of the contact, -1 where it has none.
        dims: (C,) rows a contact.
        reference: (R,) the rows' reference acceleration, changed.
        impedance: (R, 4) stiffness, damping, impedance and its slope of each row.
        approach: (R,) the rows' velocity without that of the spheres, changed.
        owner: (G,) of each geom: sphere k as k, prop p as -3 - p, the floor as FLOOR.
        velocities: (S, 3) of the spheres, metres a second.
        bounce: (P,) speed after a bounce over the speed before.
        push_out: metres a second.
        step: seconds.
        touched: (P,) changed: which sphere a prop touches, FLOOR, or kept.
    """
    for c in range(distances.shape[0]):
        row = addresses[c]
        if row < 0:
            continue
        first, second = owner[geoms[c, 0]], owner[geoms[c, 1]]
        stiffness, damping, share = impedance[row, 0], impedance[row, 1], impedance[row, 2]
        if stiffness > 0.0:
            # The depth at which stiffness and damping are in balance at the speed that is allowed.
            deepest = push_out * damping / (stiffness * share)
            if distances[c] < -deepest:
                reference[row] += stiffness * share * (distances[c] + deepest)
        for side in range(2):
            mine, other = (first, second) if side == 0 else (second, first)
            if other <= -3 and mine > -3 and (mine >= 0 or touched[-3 - other] == NOTHING):
                touched[-3 - other] = mine
            if mine < 0:
                continue
            # The relative velocity is that of the second less that of the first.
            sign = 1.0 if side == 0 else -1.0
            for r in range(min(dims[c], 3)):
                along = 0.0
                for a in range(3):
                    along += frames[c, 3 * r + a] * velocities[mine, a]
                reference[row + r] += sign * impedance[row + r, 1] * along
                approach[row + r] -= sign * along
        springy = 0.0
        for who in (first, second):
            if who <= -3:
                springy = max(springy, bounce[-3 - who])
        if springy > 0.0 and approach[row] < -_SLOW:
            reference[row] = max(reference[row], -(1.0 + springy) * approach[row] / step)


@njit(cache=True, nogil=True)
def limit_speeds(velocities, fastest, fastest_turn):
    """Limits the rows of (P, 6) linear and angular velocities; returns False where one is not finite.

    Slow rows are braked as well: gravity is far faster, so nothing hangs, but a tower that would tremble by a
    tenth of a millimetre for ever, as contacts come and go, stands still.
    """
    for p in range(velocities.shape[0]):
        moving = velocities[p, 0] ** 2 + velocities[p, 1] ** 2 + velocities[p, 2] ** 2
        turning = velocities[p, 3] ** 2 + velocities[p, 4] ** 2 + velocities[p, 5] ** 2
        if moving < _CALM * _CALM and turning < _CALM_TURN * _CALM_TURN:
            for a in range(6):
                velocities[p, a] *= _BRAKE
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
