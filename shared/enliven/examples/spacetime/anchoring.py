"""Contact, frame by frame: the control point that is the anchor, and the root that keeps it in place."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit


@njit(cache=True, nogil=True)
def stand(turned, feet, stands, grip, first, last, root, anchors):
    """Kernel: contact from frame ``first`` to ``last``, upon the frame before.

    Args:
        turned: (F, P, 3) metres, the control points with the yaw.
        feet: (K,) numbers of those it can stand on.
        stands: (F, K) bool, which of them the performer stands on; none where that is not known.
        grip: metres that another foot must be lower than the anchor to take over where it is not.
        root: (F, 3) metres, is written.
        anchors: (F,) numbers of control points, -1 in flight; is written.
    """
    for f in range(first, last + 1):
        lowest = np.inf
        for foot in feet:
            lowest = min(lowest, turned[f, foot, 1])
        before = anchors[f - 1] if f > 0 else -1
        anchor = _anchor(turned[f], feet, stands[f], before, lowest + grip)
        anchors[f] = anchor
        if f > 0:
            # The new anchor has not moved since the frame before, whoever was the anchor then.
            for c in range(3):
                root[f, c] = root[f - 1, c] + turned[f - 1, anchor, c] - turned[f, anchor, c]
        root[f, 1] = -lowest


@njit(cache=True, nogil=True)
def _anchor(places, feet, stands, before, highest):
    """The next anchor after ``before`` (-1: none): a foot that stands, for as long as it does; else the
    lowest foot, or the anchor before while it is not above ``highest``."""
    known = stands.any()
    best, height = -1, np.inf
    for k in range(len(feet)):
        stays = feet[k] == before and (stands[k] if known else places[before, 1] <= highest)
        if stays:
            return before
        if (stands[k] or not known) and places[feet[k], 1] < height:
            best, height = feet[k], places[feet[k], 1]
    return best
