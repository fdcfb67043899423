"""The energy minimised by the squash-and-stretch surface, for tests that it never increases."""

import math

from enliven.kernels import njit


def total_energy(solver):
    """Returns eq. 4 of the shape state, with each cell at its best rotation and scale, plus the terms of soft
    handles."""
    solver._fit_cells()
    total = float(
        cells_energy(solver._surface.cells, solver._frames.reshape(-1), float(solver.settings.hold))
    )
    for name, handle in solver.handles.items():
        if handle.weight is not None:
            now = solver._frames[solver._surface.place_of[list(handle.vertices)], 12:15]
            gap = now + solver._surface.centre - solver._wanted[name]
            total += handle.weight * float((gap**2).sum())
    return total


@njit(cache=True, nogil=True)
def cells_energy(cells, frames, hold):
    """Returns eq. 4: the sum of w |e' - T e|² over all cells and their edges, plus hold · c (s - 1)²."""
    total = 0.0
    for i in range(len(cells.size)):
        s = math.sqrt(frames[16 * i] ** 2 + frames[16 * i + 1] ** 2 + frames[16 * i + 2] ** 2)
        total += hold * cells.size[i] * (s - 1.0) ** 2
        for e in range(cells.start[i], cells.start[i + 1]):
            j, w = cells.neighbour[e], cells.spokes[4 * e + 3]
            for k in range(3):
                moved = frames[16 * i + 12 + k] - frames[16 * j + 12 + k]
                for c in range(3):
                    moved -= frames[16 * i + 4 * c + k] * cells.spokes[4 * e + c] / w
                total += w * moved * moved
    return total
