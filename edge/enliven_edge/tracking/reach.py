"""Which of a frame's pixels belong to the person that was there a moment ago."""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven.arrays import Bool, Float
from enliven_edge.tracking.foreground import label
from enliven_edge.tracking.posture import Posture

_REACH = 0.22
_MOSTLY = 0.35


def within_reach(z: Float, points: Float, mask: Bool, posture: Posture) -> Bool:
    """(h, w) the candidates near the posture, and the rest of any group that mostly is near it.

    The rest is what lets an arm that was lost come back: it hangs together with the body.

    Args:
        z: (h, w) metres along the optical axis.
        points: (h, w, 3) world frame.
        mask: (h, w) candidates.
    """
    ends, radii = posture.capsules()
    near = near_capsules(points, mask, ends, radii, _REACH)
    labels, count = label(z, mask)
    size = np.bincount(labels.ravel(), minlength=count + 1)
    close = np.bincount(labels.ravel(), near.ravel(), minlength=count + 1)
    mostly = close > _MOSTLY * size
    mostly[0] = False
    return np.asarray(near | mostly[labels])


@njit(cache=True, nogil=True)
def near_capsules(points, mask, ends, radii, reach):  # type: ignore[no-untyped-def]
    """(h, w) masked points within ``reach`` metres of the surface of any capsule."""
    height, width = mask.shape
    out = np.zeros((height, width), np.bool_)
    for v in range(height):
        for u in range(width):
            if not mask[v, u]:
                continue
            for c in range(len(ends)):
                ax, ay, az = ends[c, 0]
                dx, dy, dz = ends[c, 1, 0] - ax, ends[c, 1, 1] - ay, ends[c, 1, 2] - az
                px, py, pz = points[v, u, 0] - ax, points[v, u, 1] - ay, points[v, u, 2] - az
                t = (px * dx + py * dy + pz * dz) / (dx * dx + dy * dy + dz * dz + 1e-12)
                t = min(1.0, max(0.0, t))
                px, py, pz = px - t * dx, py - t * dy, pz - t * dz
                limit = radii[c, 0] + t * (radii[c, 1] - radii[c, 0]) + reach
                if px * px + py * py + pz * pz < limit * limit:
                    out[v, u] = True
                    break
    return out
