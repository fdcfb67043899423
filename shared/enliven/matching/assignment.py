"""Kernels that assign target branches to source branches. They score all choices of branches, or only the
best choices if there are too many.

A *choice* is a set of m of n columns. Its score is the highest sum of gains among the m! ways to assign one
column to each row. All choices are scored at once by dynamic programming, f(S) = max over j in S of f(S
without j) + gain[|S| - 1, j]. This needs sum_i C(n, i) i additions instead of C(n, m) m! m. If there are too
many choices, only the k best are enumerated with Murty's algorithm (in the form of Lawler 1972). Finding the
best choice is an assignment problem. The remaining choices are split into m parts: without the first column
of the best choice, with the first but without its second column, and so on. Each part is again an assignment
problem.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int
from enliven.kernels import copy_row, njit


@njit(cache=True, nogil=True)
def binomials(most):
    """Returns the binomial coefficients C(n, k) as float64 (most + 1, most + 2), exact up to 2^53."""
    table = np.zeros((most + 1, most + 2))
    table[:, 0] = 1.0
    for n in range(1, most + 1):
        for k in range(1, n + 1):
            table[n, k] = table[n - 1, k - 1] + table[n - 1, k]
    return table


@njit(cache=True, nogil=True)
def all_choices(gain, count, scores, picks):
    """Scores every choice of m of n columns, m <= n, in colexicographic order.

    Args:
        gain: (m, n) the gain of each row for each column.
        count: (n + 1, n + 2) binomial coefficients from :func:`binomials`, or a larger table.
        scores: (C(n, m),) output, the highest sum of gains of each choice.
        picks: (C(n, m), m) int32 output, the column of each row.
    """
    m, n = gain.shape
    start = np.zeros(m + 2, np.int64)
    for k in range(m + 1):
        start[k + 1] = start[k] + int(count[n, k])
    last = np.zeros(start[m + 1], np.int32)
    before = np.zeros(1)
    members = np.empty(m, np.int64)
    for k in range(1, m + 1):
        size = int(count[n, k])
        current = np.empty(size)
        for i in range(k):
            members[i] = i
        for place in range(size):
            current[place] = -np.inf
            without = place - _rank_decrease(count, members, 0, k)
            for p in range(k):
                value = before[without] + gain[k - 1, members[p]]
                if value > current[place]:
                    current[place] = value
                    last[start[k] + place] = members[p]
                if p + 1 < k:
                    # Update ``without`` from the rank of the set without member p to the rank of the set
                    # without member p + 1.
                    without += int(count[members[p], p + 1]) - int(count[members[p + 1], p + 1])
            _advance_set(members, k)
        before = current
    copy_row(scores, before)
    for i in range(m):
        members[i] = i
    remaining = np.empty(m, np.int64)
    for place in range(len(scores)):
        copy_row(remaining, members)
        for k in range(m, 0, -1):
            column = last[start[k] + _set_rank(count, remaining, k)]
            picks[place, k - 1] = column
            _remove_member(remaining, k, column)
        _advance_set(members, m)


@njit(cache=True, nogil=True)
def _rank_decrease(count, members, p, k):
    """Returns the decrease of the rank of a set of k members if member p is removed."""
    change = int(count[members[p], p + 1])
    for i in range(p + 1, k):
        change += int(count[members[i], i + 1]) - int(count[members[i], i])
    return change


@njit(cache=True, nogil=True)
def _set_rank(count, members, k):
    """Returns the colexicographic rank of k ascending members."""
    total = 0
    for i in range(k):
        total += int(count[members[i], i + 1])
    return total


@njit(cache=True, nogil=True)
def _advance_set(members, k):
    """Advances k ascending members to the next set in colexicographic order."""
    i = 0
    while i + 1 < k and members[i] + 1 == members[i + 1]:
        members[i] = i
        i += 1
    members[i] += 1


@njit(cache=True, nogil=True)
def _remove_member(members, k, value):
    """Removes a value from k ascending members."""
    moved = False
    for i in range(k):
        if members[i] == value:
            moved = True
        if moved and i + 1 < k:
            members[i] = members[i + 1]


def solve_assignment(cost: Float) -> tuple[Int, Int]:
    """Solves the assignment problem with the lowest total cost.

    Args:
        cost: (M, N) the cost of each column for each row.

    Returns:
        (K,) ascending rows, and (K,) the column of each row, with K = min(M, N).

    The result is the same as that of SciPy's ``linear_sum_assignment``, which is not used because importing
    ``scipy.optimize`` would take 0.1 s at each start.

    Raises:
        ValueError: if a cost is not finite.
    """
    if not np.isfinite(cost).all():
        raise ValueError("a cost of the assignment problem is not finite")
    if cost.shape[0] > cost.shape[1]:
        columns, rows = solve_assignment(cost.T)
        order = np.argsort(rows)
        return rows[order], columns[order]
    assigned = np.empty(len(cost), np.int32)
    assign(np.ascontiguousarray(-cost, np.float64), np.zeros(cost.shape[1], np.int8), assigned)
    return np.arange(len(cost)), assigned.astype(np.int64)


@njit(cache=True, nogil=True)
def assign(gain, state, columns):
    """Finds the best column for each row by shortest augmenting paths. Each column is used at most once.

    Args:
        gain: (m, n), m <= n.
        state: (n,) int8: 1 for columns that must be used, -1 for columns that must not be used. At most m
            columns may have 1, and at least m columns must not have -1.
        columns: (m,) int32 output, the column of each row.

    Returns:
        The sum of the gains.
    """
    m, n = gain.shape
    bonus = 1.0
    for i in range(m):
        for j in range(n):
            bonus = max(bonus, abs(gain[i, j]))
    bonus *= 2.0 * m + 1.0
    rows_of = np.full(n + 1, -1, np.int64)
    row_price, column_price = np.zeros(m), np.zeros(n + 1)
    for row in range(m):
        _assign_row(gain, state, bonus, row, rows_of, row_price, column_price)
    total = 0.0
    for j in range(n):
        if rows_of[j] >= 0:
            columns[rows_of[j]] = j
            total += gain[rows_of[j], j]
    return total


@njit(cache=True, nogil=True)
def _assign_row(gain, state, bonus, row, rows_of, row_price, column_price):
    """Assigns a column to one more row. Column n is a placeholder for the row that does not have a column
    yet."""
    # Grow a tree of shortest alternating paths (Dijkstra with reduced costs) to a free column.
    n = gain.shape[1]
    nearest = np.full(n + 1, np.inf)
    previous = np.full(n + 1, n, np.int64)
    visited = np.zeros(n + 1, np.bool_)
    rows_of[n] = row
    at = n
    while rows_of[at] >= 0:
        visited[at] = True
        step, following = np.inf, -1
        for j in range(n):
            if visited[j] or state[j] < 0:
                continue
            cost = -gain[rows_of[at], j] - (bonus if state[j] > 0 else 0.0)
            reduced = cost - row_price[rows_of[at]] - column_price[j]
            if reduced < nearest[j]:
                nearest[j], previous[j] = reduced, at
            if nearest[j] < step:
                step, following = nearest[j], j
        # Update the prices so that reduced costs stay non-negative.
        for j in range(n + 1):
            if visited[j]:
                row_price[rows_of[j]] += step
                column_price[j] -= step
            else:
                nearest[j] -= step
        at = following
    # Reassign the columns along the path.
    while at != n:
        rows_of[at] = rows_of[previous[at]]
        at = previous[at]


@njit(cache=True, nogil=True)
def best_choices(gain, scores, picks):
    """Enumerates the best choices of m of n columns, the best first, up to the size of ``scores`` (Murty's
    algorithm).

    Args:
        gain: (m, n), m <= n.
        scores: (K,) output, descending, K <= C(n, m).
        picks: (K, m) int32 output, the column of each row.
    """
    m, n = gain.shape
    room = len(scores) * m + 1
    states = np.zeros((room, n), np.int8)
    columns = np.empty((room, m), np.int32)
    values = np.empty(room)
    values[0] = assign(gain, states[0], columns[0])
    used = 1
    open_ = np.zeros(room, np.bool_)
    open_[0] = True
    for k in range(len(scores)):
        # In Murty's algorithm, the optimum of the best remaining part is the next choice.
        best = -1
        for i in range(used):
            if open_[i] and (best < 0 or values[i] > values[best]):
                best = i
        open_[best] = False
        scores[k] = values[best]
        copy_row(picks[k], columns[best])
        # Split the remaining choices of this part. Each new part forbids one column of the optimum, and
        # requires the columns before it.
        state = states[best].copy()
        free = n
        for j in range(n):
            free -= state[j] < 0
        for j in np.sort(columns[best]):
            if state[j] != 0 or used == room:
                continue
            copy_row(states[used], state)
            states[used, j] = -1
            if free > m:
                values[used] = assign(gain, states[used], columns[used])
                open_[used] = True
                used += 1
            state[j] = 1
