"""Pose graph optimisation: places many sensors from measurements between pairs of them.

Every pair measured a_from_b with its precision. Least squares finds the placements world_from_sensor that
contradict the measurements least, with the first sensor fixed. If not all views overlap, chains of pairs
connect the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from enliven.arrays import Float
from enliven_edge.fusion.calibration.refinement import Fit
from enliven_edge.fusion.placement import inverse, moved, rigid, rotation_vector, turn

Edge = tuple[str, str, Fit, bool]
"""Sensor a, sensor b, their measured fit, and whether it was judged good."""


@dataclass(frozen=True)
class SensorPlacement:
    """The placement (4, 4) and the lag in seconds of each sensor that is connected to the first one.

    ``loop`` (metres) and ``turn`` (radians) are the maximum residuals of a measurement: the loop closure
    error.
    """

    world_from_sensor: dict[str, Float]
    lags: dict[str, float]
    loop: float
    turn: float


def network(names: Sequence[str], edges: list[Edge]) -> SensorPlacement:
    """Computes the placements from all good edges. Other edges only connect sensors that were unconnected."""
    used = _used(names, edges)
    places, lags = _spread(names[0], used)
    loose = [name for name in names[1:] if name in places]
    if len(used) > len(loose):
        places = _relaxed(names[0], loose, places, used)
        lags = _levelled(names[0], loose, used)
    errors = [_error(places[a], places[b], fit) for a, b, fit, _ in used]
    loop = max((float(np.linalg.norm(e[3:6])) for e in errors), default=0.0)
    return SensorPlacement(
        places, lags, loop, max((float(np.linalg.norm(e[:3])) for e in errors), default=0.0)
    )


def _strength(edge: Edge) -> tuple[bool, float]:
    """Returns a sort key of edges: good ones first, then those with the most certain direction."""
    return edge[3], float(np.linalg.eigvalsh(edge[2].precision[:6, :6])[0])


def _used(names: Sequence[str], edges: list[Edge]) -> list[Edge]:
    """Returns all good edges, and of the others the fewest that connect all sensors (Kruskal's algorithm)."""
    group = {name: name for name in names}
    kept = []
    for edge in sorted(edges, key=_strength, reverse=True):
        a, b = group[edge[0]], group[edge[1]]
        if a != b or edge[3]:
            kept.append(edge)
        group = {name: (a if g == b else g) for name, g in group.items()}
    return kept


def _spread(root: str, edges: list[Edge]) -> tuple[dict[str, Float], dict[str, float]]:
    """Returns placements and lags along the strongest spanning tree."""
    places, lags = {root: np.eye(4)}, {root: 0.0}
    for _ in edges:
        for a, b, fit, _ in edges:
            if a in places and b not in places:
                places[b], lags[b] = places[a] @ fit.a_from_b, lags[a] + fit.lag
            elif b in places and a not in places:
                places[a], lags[a] = places[b] @ inverse(fit.a_from_b), lags[b] - fit.lag
    return places, lags


def _relaxed(root: str, free: list[str], places: dict[str, Float], edges: list[Edge]) -> dict[str, Float]:
    """Returns the placements with the smallest residuals, each pair weighted by its precision."""
    factors = [np.linalg.cholesky(fit.precision[:6, :6] + 1e-9 * np.eye(6)).T for _, _, fit, _ in edges]

    def placed(x: Float) -> dict[str, Float]:
        poses = {root: places[root]}
        for name, step in zip(free, x.reshape(-1, 6), strict=True):
            base = places[name]
            poses[name] = rigid(turn(step[:3]) @ base[:3, :3], base[:3, 3] + step[3:])
        return poses

    def contradictions(x: Float) -> Float:
        poses = placed(x)
        return np.concatenate(
            [
                factor @ _error(poses[a], poses[b], fit)
                for factor, (a, b, fit, _) in zip(factors, edges, strict=True)
            ]
        )

    start = np.zeros(6 * len(free))
    return placed(np.asarray(least_squares(contradictions, start, x_scale="jac").x))


def _error(world_from_a: Float, world_from_b: Float, fit: Fit) -> Float:
    """Returns (6,) the difference of the placements from the fit: rotation about its centre, and shift."""
    placed = inverse(world_from_a) @ world_from_b
    turned = rotation_vector(placed[:3, :3] @ fit.a_from_b[:3, :3].T)
    shift = moved(placed, moved(inverse(fit.a_from_b), fit.centre)) - fit.centre
    return np.concatenate([turned, shift])


def _levelled(root: str, free: list[str], edges: list[Edge]) -> dict[str, float]:
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
