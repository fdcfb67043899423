"""The way of a mesh that its own steps lead astray, drawn back to the performer's in the long run.

drawn_back(placed, way, step, size, leash)      # the same steps; never far from where the performer went

A mesh goes over the floor by its own feet, and feet of another build slip a little at every step: a fish
would be metres away in the end from a performer who stays. So where it leaves the performer's way, in its own
size, by more than a leash, it is drawn back, too slowly for a single step to be seen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.examples.spacetime.locomotion import PlacedMotion

_SLOWLY = 1.0
"""Seconds, the width of what the way is evened by: a stride."""
_STRIDES = (0.5, 1.5)
"""A mesh's strides, in the performer's strides in its own size: less and more is no stride but a drift."""


def drawn_back(placed: PlacedMotion, way: Float, step: float, size: float, leash: float) -> PlacedMotion:
    """The motion of a mesh that stays within about a leash of the performer's way.

    Args:
        way: (F, 3) metres, the performer's hips in the axes of the mesh.
        step: seconds between frames.
        size: the mesh's metres for one of the performer's.
        leash: metres that it may be away.
    """
    wanted, own = way[:, [0, 2]] - way[0, [0, 2]], placed.root[:, [0, 2]] - placed.root[0, [0, 2]]
    off = _slow(_in_own_size(wanted, own, size) - own, step)
    far = np.linalg.norm(off, axis=1)
    if far.max() <= leash:
        return placed
    pull = np.zeros_like(placed.root)
    beyond = off * (np.maximum(far - leash, 0.0) / np.maximum(far, 1e-12))[:, None]
    slow = _slow(beyond, step)
    pull[:, [0, 2]] = slow - slow[0]
    return replace(placed, root=placed.root + pull, world=placed.world + pull[:, None])


def _slow(way: Float, step: float) -> Float:
    """(F, 2) what is slow of a way (F, 2), of frames ``step`` seconds apart."""
    return np.asarray(scipy.ndimage.gaussian_filter1d(way, _SLOWLY / step, axis=0, mode="nearest"))


def _in_own_size(wanted: Float, own: Float, size: float) -> Float:
    """(F, 2) the performer's way (F, 2) as long, and in the direction, that fits the mesh's own best.

    That is a similarity by least squares: what looks aside walks aside, and legs have strides of their own.
    """
    p, x = wanted @ [1.0, 1.0j], own @ [1.0, 1.0j]
    fit = complex(np.vdot(p, x) / max(float(np.vdot(p, p).real), 1e-12))
    way = fit / abs(fit) if abs(fit) > 1e-9 else 1.0
    fitted = p * way * np.clip(abs(fit), _STRIDES[0] * size, _STRIDES[1] * size)
    return np.stack([fitted.real, fitted.imag], axis=1)
