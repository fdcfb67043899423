"""Solves one control point's trajectory in compiled code: Newton's method on the dual, globally and in
windows.

When weights reach or leave their bounds, the piecewise quadratic energy switches to another piece. This
usually happens at few frames. After each step over all frames, windows around these frames are solved with
the other frames fixed. Then all frames are solved again. A step over all frames that would not decrease the
energy is damped. The iteration ends when a step over all frames changes no piece. The solution is then exact.
With costs far outside the range of the settings, it may stop after many rounds with the best result so far.
"""

from __future__ import annotations

import numpy as np

from enliven.examples.spacetime.banded import factorize_band, substitute
from enliven.examples.spacetime.bounded import solve_nodes, workspace
from enliven.kernels import copy_rows, njit

_WINDOW_MARGIN_ROWS = 16
"""Rows of a window before and after a changed piece."""
_MAX_ROUNDS = 60
"""Maximum number of Newton steps over all frames. The iteration ends earlier if no frame changes its
quadratic piece."""
_MAX_STEPS = np.int64(40)
"""Maximum number of Newton steps in a window. It is an int64, because Numba gives a plain int a separate type
(a literal)."""
_MAX_HALVINGS = 20
"""Maximum number of halvings of a step. A millionth of the step is left then."""


@njit(cache=True, nogil=True)
def solve_point(node, known, weight, low, high, places):
    """Kernel: solves the positions ``places`` (F, 3) of one point. Returns the number of factored block rows.

    ``node`` and ``known`` are the point's arrays (``answers``). The functions below share these arguments:

    - ``y`` (F - 2, 3): the accelerations times lambda.
    - ``goal`` (F - 2, 3): the end of a Newton step.
    - ``how``: (lambda, low, high).
    - ``work``: the nodes' workspace.
    - ``marks`` (F,): frames that changed their quadratic piece.
    - ``band``: arrays for the factor (inverse, first_blocks, second_blocks), a right-hand side (F - 2, 3, 1)
      and the pull (F, 3).
    """
    frames = len(places)
    rows = max(frames - 2, 0)
    y, goal, saved = np.zeros((rows, 3)), np.zeros((rows, 3)), np.zeros((rows, 3))
    first_blocks, second_blocks, inverse = (
        np.empty((rows, 3, 3)),
        np.empty((rows, 3, 3)),
        np.empty((rows, 3, 3)),
    )
    band = (inverse, first_blocks, second_blocks, np.empty((rows, 3, 1)), np.empty((frames, 3)))
    marks = np.zeros(frames, np.bool_)
    work = workspace(node[1].shape[1])
    how, start, once = (weight, low, high), np.int64(0), np.int64(1)
    _, value = _evaluate_rows(node, known, y, start, rows, how, work, places, marks, band)
    factored = 0
    for _ in range(_MAX_ROUNDS):
        copy_rows(saved, y)
        _newton_step(node, known, y, goal, start, rows, how, band)
        copy_rows(y, goal)
        changed, new = _evaluate_rows(node, known, y, start, rows, how, work, places, marks, band)
        factored += rows
        if changed == 0:
            break
        factored += _solve_windows(node, known, y, goal, how, work, places, marks, band)
        _, new = _evaluate_rows(node, known, y, start, rows, how, work, places, marks, band)
        if new > value + _rounding_tolerance(value):
            copy_rows(y, saved)
            _, value = _evaluate_rows(node, known, y, start, rows, how, work, places, marks, band)
            new, steps = _solve_rows(node, known, y, goal, start, rows, how, work, places, marks, band, once)
            factored += steps * rows
        value = new
    return factored


@njit(cache=True, nogil=True)
def _rounding_tolerance(value):
    return 1e-13 * (abs(value) + 1.0)


@njit(cache=True, nogil=True)
def _solve_windows(node, known, y, goal, how, work, places, marks, band):
    """Solves the rows around each marked frame separately. Returns the number of factored rows."""
    rows, factored = len(y), 0
    wanted = marks.copy()
    done = 0
    for f in range(len(wanted)):
        if not wanted[f] or f < done:
            continue
        start, end = max(f - 2 - _WINDOW_MARGIN_ROWS, 0), min(f + 1 + _WINDOW_MARGIN_ROWS, rows)
        # Merge windows that overlap or touch.
        ahead = f + 1
        while ahead < len(wanted) and ahead - 2 - _WINDOW_MARGIN_ROWS <= end:
            if wanted[ahead]:
                end = min(ahead + 1 + _WINDOW_MARGIN_ROWS, rows)
            ahead += 1
        # Skip a window with all rows, because the next step over all frames does the same.
        if end - start < rows:
            _, steps = _solve_rows(
                node, known, y, goal, start, end, how, work, places, marks, band, _MAX_STEPS
            )
            factored += steps * (end - start)
        done = max(end, f + 1)
    return factored


@njit(cache=True, nogil=True)
def _solve_rows(node, known, y, goal, a, b, how, work, places, marks, band, most):
    """Runs damped Newton steps on rows a..b, with the other rows fixed. Returns the dual energy of the
    affected frames, and the number of steps."""
    _, value = _evaluate_rows(node, known, y, a, b, how, work, places, marks, band)
    before = np.empty((b - a, 3))
    for step in range(most):
        _newton_step(node, known, y, goal, a, b, how, band)
        copy_rows(before, y[a:b])
        copy_rows(y[a:b], goal[a:b])
        changed, new = _evaluate_rows(node, known, y, a, b, how, work, places, marks, band)
        if changed == 0:
            return new, step + 1
        share = 1.0
        for _ in range(_MAX_HALVINGS):
            if new <= value + _rounding_tolerance(value):
                break
            share *= 0.5
            for r in range(a, b):
                for i in range(3):
                    y[r, i] = before[r - a, i] + share * (goal[r, i] - before[r - a, i])
            _, new = _evaluate_rows(node, known, y, a, b, how, work, places, marks, band)
        value = new
    return value, most


@njit(cache=True, nogil=True)
def _evaluate_rows(node, known, y, a, b, how, work, places, marks, band):
    """Evaluates the nodes at the frames that rows a..b affect. Returns the number of changed nodes, and the
    dual energy, which is to be minimized."""
    weight, low, high = how
    rows, value, last = len(y), 0.0, min(b + 2, len(places))
    pull = band[4]
    for r in range(a, b):
        value += 0.5 * (y[r, 0] * y[r, 0] + y[r, 1] * y[r, 1] + y[r, 2] * y[r, 2])
    for f in range(a, last):
        # Compute q = lambda A' y. Row r affects frames r, r + 1 and r + 2.
        qx, qy, qz = 0.0, 0.0, 0.0
        for k in range(3):
            r = f - k
            if 0 <= r < rows:
                entry = weight if k != 1 else -2.0 * weight
                qx, qy, qz = qx + entry * y[r, 0], qy + entry * y[r, 1], qz + entry * y[r, 2]
        pull[f, 0], pull[f, 1], pull[f, 2] = qx, qy, qz
    changed, energy = solve_nodes(node, known, pull, a, last, low, high, work, places, marks)
    return changed, value - energy


@njit(cache=True, nogil=True)
def _newton_step(node, known, y, goal, a, b, how, band):
    """Computes ``goal`` of rows a..b: the minimum for the current quadratic pieces, with the other rows
    fixed."""
    weight = how[0]
    base, give = known[2], known[3]
    inverse, first_blocks, second_blocks, right = band[0][a:b], band[1][a:b], band[2][a:b], band[3][a:b]
    rows = len(y)
    factorize_band(give[a : b + 2], weight, inverse, first_blocks, second_blocks)
    for r in range(a, b):
        for i in range(3):
            right[r - a, i, 0] = weight * (base[r, i] - 2.0 * base[r + 1, i] + base[r + 2, i])
    # Add the effect of the rows outside the window on the first two and the last two frames inside.
    for r in range(max(a - 2, 0), min(b + 2, rows)):
        if a <= r < b:
            continue
        for s in range(max(r - 2, a), min(r + 3, b)):
            for f in range(max(r, s), min(r, s) + 3):
                entry = weight * weight * (-2.0 if f == r + 1 else 1.0) * (-2.0 if f == s + 1 else 1.0)
                for i in range(3):
                    for j in range(3):
                        right[s - a, i, 0] -= entry * give[f, i, j] * y[r, j]
    substitute(inverse, first_blocks, second_blocks, right)
    for r in range(a, b):
        for i in range(3):
            goal[r, i] = right[r - a, i, 0]
