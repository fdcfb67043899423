"""Matches the bodies of two sensors frame by frame, and makes first guesses of the transform between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from enliven.arrays import Bool, Float
from enliven.space.rigid_transform import fit_rigid, transform_points
from enliven_edge.fusion.calibration.clock import find_likely_lags
from enliven_edge.fusion.calibration.tracks import BodyStream, BodyTrack
from enliven_edge.fusion.live.side_assignment import OTHER_SIDE, midline_points, midline_weights
from enliven_edge.fusion.settings import MAX_TRACK_GAP_S, CalibrationSettings

_MAX_FRAMES = 240
"""Number of frames in a first guess. More frames take time and do not add accuracy, because refinement
follows."""
_RANSAC_DRAWS = 60
"""Number of random pairs of frames tried for each guess (RANSAC). Some of them contain no wrong match."""
_MAX_TRACKS = 4
"""Number of people per sensor for first guesses. Those with the longest tracks are used. The number of pairs
grows with the square."""
_SAME_PERSON_M = 0.35
"""Maximum distance in metres between the trunks of one person as seen by two roughly placed sensors."""


@dataclass(frozen=True)
class BodyMatch:
    """The bodies of one person as seen by two sensors.

    Attributes:
        a, b: the person's track by each sensor.
        times: (N,) the moments of the match, seconds of the first sensor's stream.
    """

    a: BodyTrack
    b: BodyTrack
    times: Float


@dataclass(frozen=True)
class InitialTransform:
    """A first estimate of a_from_b (4, 4), and of the lag: the seconds to add to b's times to get a's
    times.
    """

    a_from_b: Float
    lag: float
    matches: tuple[BodyMatch, ...]


def generate_guesses(
    a: BodyStream, b: BodyStream, known_lag: float | None, settings: CalibrationSettings
) -> Iterator[InitialTransform]:
    """Yields every plausible first estimate: pairs of people, lags of their clocks, and both assignments of
    left and right.
    """
    upright = settings.floor_known
    for track_a in a.tracks[:_MAX_TRACKS]:
        for track_b in b.tracks[:_MAX_TRACKS]:
            if min(len(track_a.times), len(track_b.times)) < 3:
                continue
            for lag in find_likely_lags(track_a, track_b, settings, known_lag):
                times = track_a.times[:: max(1, len(track_a.times) // _MAX_FRAMES)]
                q, _, is_seen_b = track_b.interpolate(times - lag, MAX_TRACK_GAP_S)
                p, _, is_seen_a = track_a.interpolate(times, MAX_TRACK_GAP_S)
                weights = is_seen_b * is_seen_a
                is_seen = weights.sum(1) > 0
                if is_seen.sum() < 3:
                    continue
                match = (BodyMatch(track_a, track_b, track_a.times),)
                for start in _estimate_transforms(p[is_seen], q[is_seen], weights[is_seen], upright):
                    yield InitialTransform(start, lag, match)


def _estimate_transforms(p: Float, q: Float, w: Float, upright: bool) -> list[Float]:
    """Returns transforms between (N, 20, 3) joints: by the midline, and by both assignments of left and
    right.
    """
    by_midline = _ransac_transform(midline_points(p), midline_points(q), midline_weights(w), upright)
    flat_weights = w.reshape(-1)
    by_sides = fit_rigid(q.reshape(-1, 3), p.reshape(-1, 3), flat_weights, upright=upright)
    by_swapped_sides = fit_rigid(
        q[:, OTHER_SIDE].reshape(-1, 3), p.reshape(-1, 3), flat_weights, upright=upright
    )
    return [by_midline, by_sides, by_swapped_sides]


def _ransac_transform(p: Float, q: Float, w: Float, upright: bool) -> Float:
    """Returns (4, 4), the transform that fits most of (N, 12, 3) points: RANSAC, then refinement."""
    random = np.random.default_rng(0)
    best, best_cost = np.eye(4), np.inf
    for _ in range(_RANSAC_DRAWS):
        sample = random.choice(len(p), size=min(2, len(p)), replace=False)
        if not w[sample].any():
            continue
        guess = fit_rigid(
            q[sample].reshape(-1, 3), p[sample].reshape(-1, 3), w[sample].reshape(-1), upright=upright
        )
        distances = np.linalg.norm(transform_points(guess, q) - p, axis=2)
        cost = float((w * np.minimum(distances, 0.5)).sum())
        if cost < best_cost:
            best, best_cost = guess, cost
    for _ in range(6):
        distances = np.linalg.norm(transform_points(best, q) - p, axis=2)
        weights = w / (1.0 + (distances / 0.15) ** 2) ** 2
        if not weights.any():
            break
        best = fit_rigid(q.reshape(-1, 3), p.reshape(-1, 3), weights.reshape(-1), upright=upright)
    return best


def match_bodies(a: BodyStream, b: BodyStream, a_from_b: Float, lag: float) -> tuple[BodyMatch, ...]:
    """Matches people at every moment, after the sensors are roughly placed.

    Uses the Hungarian algorithm with a maximum distance.
    """
    times = np.unique(np.concatenate([t.times for t in a.tracks]))
    distances: list[list[Float]] = []
    for track_a in a.tracks:
        p, _, seen_a = track_a.interpolate(times, MAX_TRACK_GAP_S)
        track_index = []
        for track_b in b.tracks:
            q, _, seen_b = track_b.interpolate(times - lag, MAX_TRACK_GAP_S)
            track_index.append(_trunk_distances(p, transform_points(a_from_b, q), seen_a * seen_b))
        distances.append(track_index)
    assignment = _assign(np.array(distances))
    return tuple(
        BodyMatch(track_a, track_b, times[assignment[i, j]])
        for i, track_a in enumerate(a.tracks)
        for j, track_b in enumerate(b.tracks)
        if assignment[i, j].sum() >= 3
    )


def _trunk_distances(p: Float, q: Float, w: Float) -> Float:
    """Returns the mean distance (N,) of the midline points in metres; inf if only one sensor sees the
    person.
    """
    weights = midline_weights(w)
    total = weights.sum(1)
    distances = (weights * np.linalg.norm(midline_points(p) - midline_points(q), axis=2)).sum(1)
    return np.where(total > 0, distances / np.where(total > 0, total, 1.0), np.inf)


def _assign(distances: Float) -> Bool:
    """Returns (A, B, N) flags: True if two tracks are one person at a time.

    Each track has at most one partner at a time.
    """
    assignment = np.zeros(distances.shape, bool)
    for n in np.flatnonzero((distances < _SAME_PERSON_M).any((0, 1))):
        cost = np.where(distances[:, :, n] < _SAME_PERSON_M, distances[:, :, n], 10.0)
        for i, j in zip(*linear_sum_assignment(cost), strict=True):
            assignment[i, j, n] = distances[i, j, n] < _SAME_PERSON_M
    return assignment
