"""How likely each joint is where it is said to be: the probability of an error below ten centimetres.

A logistic regression on what the frame says for and against the joint (:mod:`evidence`). Its weights are
fitted on synthetic sequences whose truth is known by ``tests/benchmarks/calibrate_confidence.py``, for the
left and the right side alike, and checked on others.
"""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking.evidence import NAMES

GROUPS = (
    "hip centre",
    "spine",
    "shoulder centre",
    "head",
    "shoulder",
    "elbow",
    "wrist",
    "hand",
    "hip",
    "knee",
    "ankle",
    "foot",
)
GROUP_OF_JOINT = np.array([0, 1, 2, 3, 4, 5, 6, 7, 4, 5, 6, 7, 8, 9, 10, 11, 8, 9, 10, 11])
"""(20,) which of :data:`GROUPS` each joint belongs to."""
_OUTSIDE = NAMES.index("outside")
_NOT_SEEN = 0.99


def confidence(evidence: Float) -> Float:
    """(20,) in [0, 1] from (20, 15) evidence; 0 where a joint's bone is outside the image altogether."""
    score = np.einsum("jf,jf->j", evidence, _weights()[GROUP_OF_JOINT])
    likely = 1.0 / (1.0 + np.exp(-np.clip(score, -30.0, 30.0)))
    return np.asarray(np.where(evidence[:, _OUTSIDE] > _NOT_SEEN, 0.0, likely))


@cache
def _weights() -> Float:
    """(12, 15) ordered by :data:`GROUPS` and :data:`evidence.NAMES`."""
    text = files("enliven_edge.assets").joinpath("confidence.json").read_text()
    table = json.loads(text)["weights"]
    return np.array([[table[group][name] for name in NAMES] for group in GROUPS])
