"""Pose graph optimisation: places many sensors from measurements between pairs of them.

Every pair measured a_from_b with its precision. Least squares finds the placements world_from_sensor with the
smallest residuals. The first sensor is fixed. Chains of pairs connect sensors with views that do not overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from enliven.arrays import Float
from enliven.space.rigid_transform import (
    compose_transform,
    invert,
    rotation_from_vector,
    rotation_vector,
    transform_points,
)
from enliven_edge.fusion.calibration.refinement import Fit

Edge = tuple[str, str, Fit, bool]
"""Sensor a, sensor b, their measured fit, and whether it was judged good."""


@dataclass(frozen=True)
class SensorPlacement:
    """The placement (4, 4) and the lag in seconds of each sensor that is connected to the first one.

    ``loop_error_m`` (metres) and ``loop_error_rad`` (radians) are the loop closure error: the maximum
    residual of a measurement.
    """

    world_from_sensor: dict[str, Float]
    lags: dict[str, float]
    loop_error_m: float
    loop_error_rad: float


def solve_pose_graph(names: Sequence[str], edges: list[Edge]) -> SensorPlacement:
    """Computes the placements from all good edges. Other edges only connect sensors that were unconnected."""
    used_edges = _select_edges(names, edges)
    places, lags = _place_along_tree(names[0], used_edges)
    free_names = [name for name in names[1:] if name in places]
    if len(used_edges) > len(free_names):
        places = _optimise_poses(names[0], free_names, places, used_edges)
        lags = _solve_lags(names[0], free_names, used_edges)
    errors = [_placement_error(places[a], places[b], fit) for a, b, fit, _ in used_edges]
    loop_error_m = max((float(np.linalg.norm(e[3:6])) for e in errors), default=0.0)
    return SensorPlacement(
        places, lags, loop_error_m, max((float(np.linalg.norm(e[:3])) for e in errors), default=0.0)
    )


def _edge_priority(edge: Edge) -> tuple[bool, float]:
    """Returns a sort key of edges: good edges first, then those with the most certain direction."""
    return edge[3], float(np.linalg.eigvalsh(edge[2].precision[:6, :6])[0])


def _select_edges(names: Sequence[str], edges: list[Edge]) -> list[Edge]:
    """Returns all good edges, and the fewest other edges that connect all sensors (Kruskal's algorithm)."""
    group = {name: name for name in names}
    selected = []
    for edge in sorted(edges, key=_edge_priority, reverse=True):
        a, b = group[edge[0]], group[edge[1]]
        if a != b or edge[3]:
            selected.append(edge)
        group = {name: (a if g == b else g) for name, g in group.items()}
    return selected


def _place_along_tree(root: str, edges: list[Edge]) -> tuple[dict[str, Float], dict[str, float]]:
    """Returns placements and lags along the strongest spanning tree."""
    places, lags = {root: np.eye(4)}, {root: 0.0}
    for _ in edges:
        for a, b, fit, _ in edges:
            if a in places and b not in places:
                places[b], lags[b] = places[a] @ fit.a_from_b, lags[a] + fit.lag
            elif b in places and a not in places:
                places[a], lags[a] = places[b] @ invert(fit.a_from_b), lags[b] - fit.lag
    return places, lags


def _optimise_poses(
    root: str, free: list[str], places: dict[str, Float], edges: list[Edge]
) -> dict[str, Float]:
    """Returns the placements with the smallest residuals. Each pair is weighted by its precision."""
    factors = [np.linalg.cholesky(fit.precision[:6, :6] + 1e-9 * np.eye(6)).T for _, _, fit, _ in edges]

    def poses_after(x: Float) -> dict[str, Float]:
        poses = {root: places[root]}
        for name, step in zip(free, x.reshape(-1, 6), strict=True):
            base = places[name]
            poses[name] = compose_transform(
                rotation_from_vector(step[:3]) @ base[:3, :3], base[:3, 3] + step[3:]
            )
        return poses

    def compute_residuals(x: Float) -> Float:
        poses = poses_after(x)
        return np.concatenate(
            [
                factor @ _placement_error(poses[a], poses[b], fit)
                for factor, (a, b, fit, _) in zip(factors, edges, strict=True)
            ]
        )

    start = np.zeros(6 * len(free))
    return poses_after(np.asarray(least_squares(compute_residuals, start, x_scale="jac").x))


def _placement_error(world_from_a: Float, world_from_b: Float, fit: Fit) -> Float:
    """Returns the difference (6,) of the placements from the fit: rotation about its centre, and shift."""
    measured_from_b = invert(world_from_a) @ world_from_b
    rotation_error = rotation_vector(measured_from_b[:3, :3] @ fit.a_from_b[:3, :3].T)
    translation_error = (
        transform_points(measured_from_b, transform_points(invert(fit.a_from_b), fit.centre)) - fit.centre
    )
    return np.concatenate([rotation_error, translation_error])


def _solve_lags(root: str, free: list[str], edges: list[Edge]) -> dict[str, float]:
    """Returns the lags with the smallest residuals: linear least squares."""
    rows, values = [], []
    for a, b, fit, _ in edges:
        weight = np.sqrt(max(float(fit.precision[6, 6]), 1e-9))
        row = np.zeros(len(free))
        if b in free:
            row[free.index(b)] += weight
        if a in free:
            row[free.index(a)] -= weight
        rows.append(row)
        values.append(weight * fit.lag)
    solved = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0]
    return {root: 0.0, **dict(zip(free, map(float, solved), strict=True))}
