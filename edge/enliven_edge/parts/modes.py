"""Where each part of somebody is: the densest places of its probability over the surface, by mean shift."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from enliven.arrays import AnyArray, Float

_RADIUS = 0.14
"""Metres within which points belong to one mode (Epanechnikov kernel)."""
_SEEDS, _SHIFTS = 3, 8
KEPT = 2
"""Modes that are kept of a part: there are two hands."""


@dataclass(frozen=True)
class Modes:
    """The parts' places.

    Attributes:
        positions: (P, 2, 3) metres, world frame, on the surface; meaningless where there is no mass.
        mass: (P, 2) square metres of visible surface that are expected to be this part there; the heavier
            of the two modes comes first.
    """

    positions: Float
    mass: Float


def part_modes(points: AnyArray, probabilities: AnyArray, area: Float) -> Modes:
    """The two heaviest modes of every part.

    Args:
        points: (M, 3) metres on the person's surface.
        probabilities: (M, P) of the parts at these points.
        area: (M,) square metres that each point stands for.
    """
    count = probabilities.shape[1]
    positions, mass = np.zeros((count, KEPT, 3)), np.zeros((count, KEPT))
    _modes(points, probabilities, area, positions, mass)
    return Modes(positions, mass)


@njit(cache=True, nogil=True)
def _modes(points, probabilities, area, positions, mass):  # type: ignore[no-untyped-def]
    """Mean shift from the surest points of every part; the heaviest ends are kept."""
    count = len(points)
    weight, place = np.empty(count), np.empty(3)
    sure = np.empty(count)
    for part in range(probabilities.shape[1]):
        for i in range(count):
            # The square keeps what is sure from being drowned by what is merely possible.
            weight[i] = probabilities[i, part] ** 2 * area[i]
            sure[i] = weight[i]
        for _ in range(_SEEDS):
            seed = np.argmax(sure)
            if sure[seed] <= 0.0:
                break
            for a in range(3):
                place[a] = points[seed, a]
            for _ in range(_SHIFTS):
                if _shift(points, weight, place) < 1e-3:
                    break
            heavy = 0.0
            for i in range(count):
                square = _square(points, i, place)
                if square < _RADIUS**2:
                    heavy += probabilities[i, part] * area[i]
                if square < 2.0 * _RADIUS**2:
                    sure[i] = 0.0
            sure[seed] = 0.0
            _keep(positions[part], mass[part], place, heavy)


@njit(cache=True, nogil=True)
def _keep(positions, mass, place, heavy):  # type: ignore[no-untyped-def]
    """Takes a mode in among the kept ones, the heaviest first, unless it is one of them."""
    for k in range(len(mass)):
        apart = 0.0
        for a in range(3):
            apart += (positions[k, a] - place[a]) ** 2
        if mass[k] > 0.0 and apart < _RADIUS**2:
            return
        if heavy > mass[k]:
            for n in range(len(mass) - 1, k, -1):
                mass[n], positions[n] = mass[n - 1], positions[n - 1]
            mass[k], positions[k] = heavy, place
            return


@njit(cache=True, nogil=True, inline="always")
def _square(points, i, place):  # type: ignore[no-untyped-def]
    return (points[i, 0] - place[0]) ** 2 + (points[i, 1] - place[1]) ** 2 + (points[i, 2] - place[2]) ** 2


@njit(cache=True, nogil=True)
def _shift(points, weight, place):  # type: ignore[no-untyped-def]
    """Moves the place to the weighted mean within the radius; metres that it went."""
    total, x, y, z = 0.0, 0.0, 0.0, 0.0
    for i in range(len(points)):
        if weight[i] > 0.0 and _square(points, i, place) < _RADIUS**2:
            total += weight[i]
            x += weight[i] * points[i, 0]
            y += weight[i] * points[i, 1]
            z += weight[i] * points[i, 2]
    if total <= 0.0:
        return 0.0
    x, y, z = x / total, y / total, z / total
    went = np.sqrt((x - place[0]) ** 2 + (y - place[1]) ** 2 + (z - place[2]) ** 2)
    place[0], place[1], place[2] = x, y, z
    return went
