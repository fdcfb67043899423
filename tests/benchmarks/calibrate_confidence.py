"""Fits the tracker's confidence to the tuning sequences: python tests/benchmarks/calibrate_confidence.py

Runs the tracker over them, pairs each joint's evidence with whether it was within ten centimetres of the
truth, and writes the weights of a regularised logistic regression to the edge's assets.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from enliven_edge.tracking.confidence import GROUP_OF_JOINT, GROUPS
from enliven_edge.tracking.evidence import NAMES

TARGET = Path(__file__).parents[2] / "edge" / "enliven_edge" / "assets" / "confidence.json"
_RIDGE = 3.0


def logistic(features: np.ndarray, right: np.ndarray, ridge: float = _RIDGE) -> np.ndarray:
    """(F,) weights by Newton's method; features are standardised inside, the constant is not shrunk."""
    centre, scale = features.mean(0), np.maximum(features.std(0), 1e-3)
    centre[0], scale[0] = 0.0, 1.0
    x = (features - centre) / scale
    penalty = np.full(x.shape[1], ridge)
    penalty[0] = 1e-6
    w = np.zeros(x.shape[1])
    for _ in range(50):
        p = 1.0 / (1.0 + np.exp(-np.clip(x @ w, -30, 30)))
        hessian = (x * (p * (1 - p))[:, None]).T @ x + np.diag(penalty)
        step = np.linalg.solve(hessian, x.T @ (right - p) - penalty * w)
        w += step
        if np.abs(step).max() < 1e-8:
            break
    weights = w / scale
    weights[0] = w[0] - (weights[1:] @ centre[1:])
    return weights


def write(evidence: np.ndarray, right: np.ndarray, sequences: list[str]) -> None:
    """Fits and writes the weights of (N, 20, F) evidence and (N, 20) outcomes."""
    table = {}
    for g, group in enumerate(GROUPS):
        of = np.flatnonzero(g == GROUP_OF_JOINT)
        weights = logistic(evidence[:, of].reshape(-1, len(NAMES)), right[:, of].ravel().astype(float))
        table[group] = {name: round(float(w), 5) for name, w in zip(NAMES, weights, strict=True)}
    text = json.dumps({"fitted on": sequences, "frames": len(evidence), "weights": table}, indent=1)
    TARGET.write_text(text + "\n")
