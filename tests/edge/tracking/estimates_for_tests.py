"""Synthetic estimates and observations with a posture's own joints and facing."""

from __future__ import annotations

import numpy as np

from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect.appearance import EstimateAtPoints, chest_facing
from enliven_edge.tracking.estimator.crop import Crop
from enliven_edge.tracking.estimator.estimator import Estimate
from enliven_edge.tracking.estimator.labels import FACINGS, PARTS

EYE = np.array([0.0, 1.2, 0.0])
_NO_CROP = Crop(np.zeros((4, 80, 64), np.float32), 2.5, 0.03, np.eye(2), np.zeros(2))


def ways_of(posture: Posture | None, plainly: float) -> np.ndarray:
    """Returns (8,) log probabilities of a posture's facing with a given contrast, uniform for None."""
    ways = np.zeros(FACINGS)
    if posture is not None:
        ways = plainly * np.cos(np.arange(FACINGS) * 2 * np.pi / FACINGS - chest_facing(posture, EYE))
    return ways - np.log(np.exp(ways).sum())


def estimate_of(joints, spread=0.03, ways: np.ndarray | None = None) -> Estimate:
    """Returns an estimate with these joints, each with a given mean error in metres."""
    by_facing = ways_of(None, 0.0) if ways is None else ways
    parts = np.zeros((PARTS, 40, 32), np.float32)
    return Estimate(np.array(joints, float), np.full(20, spread) * 1.0, by_facing, parts, _NO_CROP)


def seen_as(estimate: Estimate, points=None, probabilities=None) -> EstimateAtPoints:
    """Returns an estimate, evaluated at points with part probabilities."""
    if points is None:
        points, probabilities = np.zeros((1, 3)), np.ones((1, PARTS)) / PARTS
    surface, shown = np.zeros((6, len(points)), np.float32), np.asarray(probabilities, np.float32)
    surface[:3] = np.transpose(points)
    return EstimateAtPoints(estimate, surface, np.ascontiguousarray(shown.T), np.zeros((len(points), 2)))
