"""Computes the rotations of one polyline at any arc length and frame, for tests. A player samples all
polylines of a shape at once.
"""

import numpy as np

from enliven.kernels import njit
from enliven.motion.kinematics.quaternions import between, load, store
from enliven.motion.layers.polyline import knot_turns, locate_on_knots
from enliven.rotation import IDENTITY


def compute_knot_rotations(line, frames, weight=1.0, basis=IDENTITY, mirrored=False):
    """Returns (T, K, 4) relative rotations P_i = D_base^-1 D_i at the knots. Each has the sign that is closer
    to its predecessor.
    """
    at = np.array(np.atleast_1d(frames), np.float64).reshape(-1, 1)
    out = np.empty((len(at), len(line.knots), 4))
    first, bases = np.array([0, len(line.bones)], np.int32), np.array([line.base], np.int32)
    how = (
        np.full((len(at), 1), weight, np.float64),
        np.array([basis], np.float64),
        np.array([mirrored], np.bool_),
    )
    knot_turns(line.clip.turns, line.bones, first, bases, at, *how, 0, out)
    return out


def sample_rotations(line, s, frames, weight=1.0, basis=IDENTITY, mirrored=False):
    """Returns (T, S, 4) q(s, t) at arc lengths ``s`` (S,) and frame numbers (T,)."""
    at_knots = compute_knot_rotations(line, frames, weight, basis, mirrored)
    knot, part = locate_on_knots(line.knots, np.atleast_1d(s))
    out = np.empty((len(at_knots), len(knot), 4))
    for t in range(len(at_knots)):
        _samples(at_knots[t], knot, part, out[t])
    return out


@njit(cache=True, nogil=True)
def _samples(knots, knot, part, out):
    """Fills ``out`` (S, 4) with slerps of the rotations ``knots`` (K, 4) from ``knot`` (S,) to the next."""
    for i in range(len(knot)):
        store(out, i, between(load(knots, knot[i]), load(knots, knot[i] + 1), part[i]))
