"""What stood somewhere and is not there any more: an image looks through where its surface was."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import minimum_filter

from enliven.arrays import Float
from enliven.scanning.depth_view import DepthView
from enliven.scanning.rigid import inverse

_NEAREST = 0.2
"""Metres before a camera, nearer than which it sees nothing."""
_BESIDE = 3
"""Half-size pixels across in which the nearest depth counts: at an edge a point may fall beside it."""
_FEWEST = 50
"""Points that an image must show to tell anything."""


def share_vacated(points: Float, view: DepthView, world_from_camera: Float, clearance: float) -> float:
    """Returns the share, 0 to 1, of the points (N, 3) in an image that lie before what it sees there.

    Points behind what it sees are hidden, and count for nothing; so do those where it knows no depth.

    Args:
        clearance: metres by which a point must lie before it.
    """
    back = inverse(world_from_camera)
    local = points @ back[:3, :3].T + back[:3, 3]
    x, y, z = local[local[:, 2] > _NEAREST].T
    # 1e9 where nothing is known: the nearest about a pixel is of those that are.
    depth = np.where(view.worth > 0, view.points[..., 2], np.float32(1e9))
    nearest = minimum_filter(depth, _BESIDE, mode="nearest")
    lens = view.intrinsics
    column = np.floor((lens.fx * x / z + lens.cx + 0.5) / 2).astype(int)
    row = np.floor((lens.fy * y / z + lens.cy + 0.5) / 2).astype(int)
    inside = (column >= 0) & (row >= 0) & (row < depth.shape[0]) & (column < depth.shape[1])
    seen, z = nearest[row[inside], column[inside]], z[inside]
    shown = (seen < 1e8) & (z < seen + clearance)
    count = int(np.count_nonzero(shown))
    return float(np.count_nonzero(shown & (z < seen - clearance))) / count if count >= _FEWEST else 0.0
