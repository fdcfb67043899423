"""The energy minimised by the squash-and-stretch surface, for tests that it never increases."""

import math

import numpy as np

from enliven.deformation.arap.cells import turn_and_scale
from enliven.kernels import njit


def fit_cells(solver, surface):
    """Returns (N, 16) the cells of the shape state, each with its best rotation and scale.

    Args:
        surface: the prepared surface of the solver's mesh.
    """
    count, settings = len(surface.rest), solver.settings
    max_stretch = float(settings.most_stretch) if settings.squash_and_stretch else 1.0
    frames = np.zeros((count, 16))
    frames[:, [0, 5, 10]] = 1.0
    frames[surface.place_of, 12:15] = solver.get_surface() - surface.centre
    hold = float(settings.hold)
    turn_and_scale(surface.cells, frames.reshape(-1), hold, 1 / max_stretch, max_stretch, 0, count)
    return frames


def total_energy(solver, surface):
    """Returns eq. 4 of the shape state, with each cell at its best rotation and scale, plus the terms of soft
    handles.

    Args:
        surface: the prepared surface of the solver's mesh.
    """
    frames = fit_cells(solver, surface)
    total = float(cells_energy(surface.cells, frames.reshape(-1), float(solver.settings.hold)))
    targets, _, _ = solver.check_targets()
    for name, handle in solver.handles.items():
        if handle.weight is not None:
            gap = solver.get_surface()[list(handle.vertices)] - targets[name]
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
