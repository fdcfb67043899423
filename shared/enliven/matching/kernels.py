"""Ranking kernels: they compute the cosines between branches, and score the choices of all candidate
sub-trees."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven.matching.assignment import all_choices, best_choices, binomials
from enliven.matching.views import MIN_DEPTH_M


@njit(cache=True, nogil=True)
def rank_rows(ends, first, source, rows, whole, missing):
    """Scores the matches of all candidates, unsorted.

    Args:
        ends: (B, 2) the target's branches on the screen, from :func:`seen_branches`.
        first: (C + 1,) index of each candidate's first branch.
        source: (m, 2) the source's branches on the screen.
        rows: (C + 1,) index of each candidate's first match.
        whole: (C,) nonzero if all choices of a candidate are scored, zero if only its best choices are.
        missing: score of a source branch without a target branch.

    Returns:
        For each match: the candidate (R,), the column of each source branch or -1 (R, m), and the score (R,).
    """
    m, count = len(source), len(first) - 1
    which = np.empty(rows[count], np.int32)
    columns = np.full((rows[count], m), -1, np.int32)
    scores = np.empty(rows[count])
    most = m
    for c in range(count):
        most = max(most, first[c + 1] - first[c])
    table = binomials(most)
    for c in range(count):
        # Compute the cosines between source and target branches. The rows belong to the side with fewer
        # branches.
        n = first[c + 1] - first[c]
        gain = np.empty((min(m, n), max(m, n)))
        for i in range(m):
            for j in range(n):
                end = ends[first[c] + j]
                cosine = source[i, 0] * end[0] + source[i, 1] * end[1]
                if m <= n:
                    gain[i, j] = cosine
                else:
                    gain[j, i] = cosine
        # Find the best choices for this candidate, with their scores.
        low, high = rows[c], rows[c + 1]
        which[low:high] = c
        picks = np.empty((high - low, len(gain)), np.int32)
        if whole[c]:
            all_choices(gain, table, scores[low:high], picks)
        else:
            best_choices(gain, scores[low:high], picks)
        # Convert the choices to columns per source branch.
        for k in range(high - low):
            for i in range(len(gain)):
                if m <= n:
                    columns[low + k, i] = picks[k, i]
                else:
                    columns[low + k, picks[k, i]] = i
            if n < m:
                scores[low + k] += (m - n) * missing
    return which, columns, scores


@njit(cache=True, nogil=True)
def seen_branches(points, first, axes, eye, perspective, blur, dots):
    """Projects branches to the screen, relative to their sub-tree's root, and normalizes them.

    For cosines, each branch gets length one. A branch seen end-on has an unreliable direction. If less than
    the fraction ``blur`` of its length is visible, it is shortened in proportion, so that its cosines fade to
    zero. For dot products, the longest branch of each sub-tree gets length one.

    Args:
        points: (C + B, 3) metres, the sub-trees' roots, then the branches' abstract positions.
        first: (C + 1,) index of each sub-tree's first branch.
        axes, eye, perspective: the view. ``axes`` (3, 3) are the directions right, up and forward, and
            ``eye`` (3,) is its position in metres. ``perspective`` is False for an orthographic view, which
            ignores the eye.
        blur: visible fraction of a branch's length below which its cosines fade.
        dots: True to normalize for dot products, False for cosines.
    """
    count = len(first) - 1
    ends = np.empty((len(points) - count, 2))
    for c in range(count):
        x, y, depth = _on_screen(points[c], axes, eye, perspective)
        longest = 0.0
        for i in range(first[c], first[c + 1]):
            right, up, _ = _on_screen(points[count + i], axes, eye, perspective)
            ends[i, 0], ends[i, 1] = right - x, up - y
            longest = max(longest, np.hypot(right - x, up - y))
        for i in range(first[c], first[c + 1]):
            size = longest
            if not dots:
                length = 0.0
                for axis in range(3):
                    length += (points[count + i, axis] - points[c, axis]) ** 2
                size = max(np.hypot(ends[i, 0], ends[i, 1]), blur * np.sqrt(length) / depth)
            for axis in range(2):
                ends[i, axis] = ends[i, axis] / size if size > 0.0 else 0.0
    return ends


@njit(cache=True, nogil=True)
def _on_screen(point, axes, eye, perspective):
    """Returns the coordinates right and up on the screen, and the depth, like
    :meth:`enliven.matching.views.ScreenView.project`."""
    x, y, z = point[0] - eye[0], point[1] - eye[1], point[2] - eye[2]
    depth = 1.0
    if perspective:
        depth = max(axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z, MIN_DEPTH_M)
    right = (axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z) / depth
    return right, (axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z) / depth, depth
