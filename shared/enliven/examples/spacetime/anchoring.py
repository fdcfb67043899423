"""Computes contact frame by frame: the control point that is the anchor, and the root motion that keeps it in
place."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit

_EQUAL_HEIGHT_M = 1e-6
"""Feet with a smaller difference in height, metres, count as equally low: the first one becomes the anchor.
Otherwise, rounding would choose between two feet that stand flat on the floor."""


@njit(cache=True, nogil=True)
def choose_anchors(turned, feet, stands, grip, first, last, root, anchors):
    """Kernel: chooses the anchor foot of the frames ``first`` to ``last``.

    It starts from the state of the frame before, and computes the root that keeps this foot in place.

    Args:
        turned: (F, P, 3) metres, the control points with the yaw applied.
        feet: (K,) numbers of the control points that the mesh can stand on.
        stands: (F, K) bool, True for feet that the performer stands on; all False if unknown.
        grip: only used if ``stands`` is unknown. Another foot becomes the anchor if it is lower than the
            anchor by at least this height, metres.
        root: (F, 3) metres, output.
        anchors: (F,) numbers of control points, -1 in flight, output.
    """
    for f in range(first, last + 1):
        lowest = np.inf
        for foot in feet:
            lowest = min(lowest, turned[f, foot, 1])
        before = anchors[f - 1] if f > 0 else -1
        anchor = _choose_anchor(turned[f], feet, stands[f], before, lowest + grip)
        anchors[f] = anchor
        if f > 0:
            # The anchor of this frame stays fixed from the previous frame to this frame, even if another
            # point was the anchor there.
            for c in range(3):
                root[f, c] = root[f - 1, c] + turned[f - 1, anchor, c] - turned[f, anchor, c]
        root[f, 1] = -lowest


@njit(cache=True, nogil=True)
def _choose_anchor(places, feet, stands, before, highest):
    """Chooses the anchor of a frame; ``before`` is the anchor of the previous frame (-1 for none).

    The previous anchor stays the anchor while the performer stands on it. Otherwise the lowest standing foot
    becomes the anchor. Of several equally low feet, the first becomes the anchor. If ``stands`` is unknown,
    the previous anchor stays the anchor while its height is at most ``highest``. Otherwise the lowest foot
    becomes the anchor.
    """
    has_standing = stands.any()
    best, height = -1, np.inf
    for k in range(len(feet)):
        stays = feet[k] == before and (stands[k] if has_standing else places[before, 1] <= highest)
        if stays:
            return before
        if (stands[k] or not has_standing) and places[feet[k], 1] < height - _EQUAL_HEIGHT_M:
            best, height = feet[k], places[feet[k], 1]
    return best
