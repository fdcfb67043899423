"""Fits the tracker's confidence to the films for tuning.

    python tests/benchmarks/tracking/calibrate_confidence.py

Runs the tracker on them, with and without the network. Labels each joint's evidence by whether the joint was
within ten centimetres of the truth. Writes the weights of a regularised logistic regression.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from tracking_cache import Moment, delivered
from tracking_scene import Sequence
from tracking_set import CLOSE, FLOOR, TUNING, TURNS, sequences

from enliven_edge.tracking.people.confidence import ALONE, GROUP_OF_JOINT, GROUPS, WITH_NETWORK
from enliven_edge.tracking.people.evidence import NAMES
from enliven_edge.tracking.people.person import Person
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.tracker import Tracker

TARGET = Path(__file__).parents[3] / "edge" / "enliven_edge" / "assets" / "confidence.json"
_RIDGE = 3.0
_WRONG_WEIGHT = 2.0
"""Weight of a wrong joint, relative to the weight of a right one.

A wrong joint with a high confidence does more harm than a right joint with a low one. With this weight, half
as many confident joints are wrong, and 3 % fewer joints are confident.
"""
_FOR = ("support", "visible", "support beside", "visible beside", "explained")
_AGAINST = (
    "seen through",
    "outside",
    "seen through beside",
    "outside beside",
    "uncertainty",
    "violated",
    "unsupported",
    "spread",
    "apart",
)
"""Evidence that can only increase a joint's confidence, and evidence that can only decrease it."""
_WITHIN = 0.1
"""The confidence is the probability that a joint is within this distance of the truth, metres."""


def logistic(features: np.ndarray, right: np.ndarray, ridge: float = _RIDGE) -> np.ndarray:
    """Returns (F,) weights by maximum likelihood.

    Wrong joints have a higher weight. Features are standardised internally, and the constant is not
    regularised. The signs of the weights are constrained. Otherwise strongly correlated features would get
    opposite weights, which is wrong in the rare cases in which they differ.
    """
    centre, scale = features.mean(0), np.maximum(features.std(0), 1e-3)
    centre[0], scale[0] = 0.0, 1.0
    x, sign = (features - centre) / scale, 2.0 * right - 1.0
    importance = np.where(right > 0.5, 1.0, _WRONG_WEIGHT)
    penalty = np.full(x.shape[1], ridge)
    penalty[0] = 1e-6

    def cost(w: np.ndarray) -> tuple[float, np.ndarray]:
        margin = sign * (x @ w)
        slope = -importance * sign / (1.0 + np.exp(np.clip(margin, -30, 30)))
        value = (importance * np.logaddexp(0.0, -margin)).sum() + 0.5 * (penalty * w) @ w
        return float(value), x.T @ slope + penalty * w

    bounds = [(0.0 if n in _FOR else None, 0.0 if n in _AGAINST else None) for n in NAMES]
    w = minimize(cost, np.zeros(x.shape[1]), jac=True, method="L-BFGS-B", bounds=bounds).x
    weights = w / scale
    weights[0] = w[0] - (weights[1:] @ centre[1:])
    return np.asarray(weights)


def fitted(evidence: np.ndarray, right: np.ndarray) -> dict[str, dict[str, float]]:
    """Returns the weights for (N, 20, F) evidence and (N, 20) outcomes, by group and name."""
    table = {}
    for g, group in enumerate(GROUPS):
        of = np.flatnonzero(g == GROUP_OF_JOINT)
        weights = logistic(evidence[:, of].reshape(-1, len(NAMES)), right[:, of].ravel().astype(float))
        table[group] = {name: round(float(w), 5) for name, w in zip(NAMES, weights, strict=True)}
    return table


def gathered(sequence: Sequence, estimator: bool) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Returns (20, F) evidence and (20,) outcome of every body in every frame of a sequence. Bodies far from
    all people count as wrong."""
    tracker, evidence, right = Tracker(TrackerSettings(estimator=estimator)), [], []
    for frame, moment in delivered(sequence):
        tracker.track(frame)
        for person in tracker.performers:
            if person.follower.evidence.any():
                evidence.append(person.follower.evidence)
                right.append(_outcome(person, moment))
    return evidence, right


def _outcome(person: Person, moment: Moment) -> np.ndarray:
    """Returns (20,) True for each joint within ten centimetres of the person with the nearest hips."""
    joints = person.follower.posture.joints()
    true = moment.joints[moment.present]
    if len(true) == 0:
        return np.zeros(20, bool)
    nearest = np.argmin(np.linalg.norm(true[:, 0] - joints[0], axis=1))
    return np.linalg.norm(true[nearest] - joints, axis=1) < _WITHIN


def main() -> int:
    """Runs the tuning sequences and writes the weights."""
    chosen = [s for split in (TUNING, CLOSE, TURNS, FLOOR) for s in sequences(split) if s.available]
    out: dict[str, object] = {"fitted on": [s.name for s in chosen]}
    for name, estimator in ((WITH_NETWORK, True), (ALONE, False)):
        evidence: list[np.ndarray] = []
        right: list[np.ndarray] = []
        for sequence in chosen:
            print(f"tracking {sequence.name} ({name})", file=sys.stderr, flush=True)
            of, outcome = gathered(sequence, estimator)
            evidence += of
            right += outcome
        out[f"frames of {name}"] = len(evidence)
        out[name] = fitted(np.array(evidence), np.array(right))
    TARGET.write_text(json.dumps(out, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
