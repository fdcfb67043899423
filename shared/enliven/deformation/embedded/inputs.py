"""Converts the solver's inputs to the kernels' format, with nodes in elimination order and without invalid
measurements."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int, Int32
from enliven.deformation.constraints.planes import PlaneConstraints, PointConstraints
from enliven.deformation.embedded.energy import SolverPlanes
from enliven.errors import InputError
from enliven.kernels import njit

_MAX_TARGET_M = 1e4
"""Distance from the origin, metres, beyond which a target cannot be a valid measurement."""
_EMPTY_ARRAY = np.empty(0)
NO_PLANES = SolverPlanes(
    np.empty((0, 4), np.int32),
    np.empty((0, 4, 4)),
    np.empty((0, 4)),
    _EMPTY_ARRAY,
    _EMPTY_ARRAY,
    np.empty(0, np.bool_),
)
"""An empty set of planes, for a frame without planes."""


def coefficient_rows(
    points: PointConstraints | PlaneConstraints, positions: Float, places: Int
) -> tuple[Int32, Float]:
    """Returns the nodes (L, 4) of each point, by ascending elimination order and without duplicates, and
    their coefficients (L, 4, 4).

    Args:
        positions: (N, 3) metres, the nodes at rest.
        places: (N,) the position of each node in the elimination order.
    """
    nodes = np.ascontiguousarray(points.node_indices, np.int64).reshape(-1, 4)
    weights = np.asarray(points.node_weights, np.float64).reshape(-1, 4)
    arms = np.asarray(points.points, np.float64).reshape(-1, 1, 3) - positions[nodes]
    rows = np.concatenate([arms, np.ones((len(nodes), 4, 1))], -1) * weights[..., None]
    place = places[nodes]
    order = np.argsort(place, 1, kind="stable")
    place = np.take_along_axis(place, order, 1)
    rows = np.take_along_axis(rows, order[..., None], 1)
    for k in (3, 2, 1):
        # If a node occurs twice, merge both entries and add their weights.
        is_repeated = place[:, k] == place[:, k - 1]
        rows[is_repeated, k - 1] += rows[is_repeated, k]
        rows[is_repeated, k] = 0.0
    return place.astype(np.int32), np.ascontiguousarray(rows)


def sort_by_node(nodes: Int32, rows: Float, count: int) -> tuple[Int32, Int32, Float]:
    """Sorts the constraints by the nodes that they act on, in the format of :class:`EnergyTerms`.

    Args:
        nodes, rows: (L, 4) and (L, 4, 4), from :func:`coefficient_rows`. A constraint does not act on a node
            with weight 0.
        count: N, the number of nodes.

    Returns:
        (N + 1,) the index at which each node's constraints start, (H,) these constraints, (4 H,) their
            coefficients for the node.
    """
    constraint, place = np.nonzero(rows[:, :, 3])
    node = nodes[constraint, place]
    order = np.argsort(node, kind="stable")
    start = np.searchsorted(node[order], np.arange(count + 1)).astype(np.int32)
    return start, constraint[order].astype(np.int32), rows[constraint, place][order].reshape(-1)


def convert_planes(
    planes: PlaneConstraints | None, weight: float, positions: Float, places: Int
) -> SolverPlanes:
    """Returns the frame's planes in the kernels' format. Planes that are not finite get zero weight.

    Args:
        weight: factor on the weights of all planes.
        positions, places: see :func:`coefficient_rows`.
    """
    if planes is None or not len(planes):
        return NO_PLANES
    nodes, rows = coefficient_rows(planes, positions, places)
    normals = np.zeros((len(nodes), 4))
    normals[:, :3] = planes.normals
    weights = weight * np.asarray(planes.weights, np.float64)
    usable = np.isfinite(normals).all(1) & (np.abs(planes.offsets) < _MAX_TARGET_M) & np.isfinite(weights)
    return SolverPlanes(
        nodes,
        rows,
        np.where(usable[:, None], normals, 0.0),
        np.where(usable, planes.offsets, 0.0),
        np.where(usable & (weights > 0), weights, 0.0),
        np.asarray(planes.one_sided, np.bool_),
    )


@njit(cache=True, nogil=True)
def copy_usable_targets(targets, weights, scale, out, pulls):
    """Copies the usable targets into ``out`` (L, 4), and the scaled weights into ``pulls`` (L,).

    The weight of an unusable target is 0.
    """
    for m in range(len(pulls)):
        usable = weights[m] > 0.0 and np.isfinite(weights[m])
        for a in range(3):
            usable = usable and abs(targets[m, a]) < _MAX_TARGET_M
        pulls[m] = scale * weights[m] if usable else 0.0
        for a in range(3):
            out[m, a] = targets[m, a] if usable else 0.0


def check_stiffness(stiffness: Float | None, count: int) -> Float:
    """Returns the stiffness factors (N,) after a check of their shape and values, or ones for None."""
    if stiffness is None:
        return np.ones(count)
    factors = np.asarray(stiffness, np.float64)
    if factors.shape != (count,) or not (np.isfinite(factors) & (factors > 0)).all():
        raise InputError(
            f"the stiffness factors have the shape {factors.shape} and the minimum "
            f"{np.min(factors, initial=np.inf):g}",
            where="embedded deformation",
            remedy=f"Pass {count} finite factors above 0, one for each node.",
        )
    return factors
