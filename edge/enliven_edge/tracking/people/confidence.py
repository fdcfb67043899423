"""The confidence of each joint: the probability that its error is below ten centimetres.

A logistic regression computes it from the frame's evidence for and against the joint (:mod:`evidence`). The
benchmark ``calibrate_confidence.py`` fits the weights to synthetic sequences with exact joints, and checks
them on other sequences. Left and right joints share their weights.
"""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files

import numpy as np

from enliven.arrays import Float
from enliven.kernels import njit
from enliven.person import Joint
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.people.evidence import NAMES

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
"""(20,) the index of each joint's group in :data:`GROUPS`."""
WITH_NETWORK, ALONE = "weights", "weights alone"
"""Names of the two tables of weights: for evidence with and without the network's estimate."""
_SEATED_HIP_RATIO = 0.42
"""If the hips of an upright person are lower than this fraction of the leg length, the person sits on the
floor."""
_UPRIGHT_COSINE = 0.5
"""Minimum cosine between the trunk and the vertical of a sitting person. A lying person has less."""
_MAX_SEATED_LEG = 0.7
"""Maximum confidence of a knee, ankle or foot of a person who sits on the floor. If legs point to the
sensor, only the feet are visible. Without this limit, 30 % of the joints with a confidence of 0.9 or more had
an error of 10 cm or more in the tuning films.
"""
_IS_LEG = np.isin(np.arange(20), [j for j in Joint if j.name.startswith(("KNEE", "ANKLE", "FOOT"))])
_OUTSIDE_EVIDENCE = NAMES.index("outside")
_UNSEEN_FRACTION = 0.99
"""If more than this fraction of a joint's bone is outside the image, its confidence is 0. The value means the
whole bone, except for rounding.
"""


def joint_confidences(evidence: Float, *, alone: bool = False) -> Float:
    """Returns (20,) in [0, 1] from (20, 17) evidence.

    A joint has confidence 0 if its bone is completely outside the image.

    Args:
        evidence: as returned by :func:`evidence.joint_evidence`.
        alone: whether the fit used depth alone, without the network.
    """
    return np.asarray(_logistic(evidence, _weights_of_joints(ALONE if alone else WITH_NETWORK)))


def limit_when_seated(sure: Float, posture: Posture) -> Float:
    """Returns (20,) confidence, in which the legs of a person who sits on the floor, y = 0, are limited."""
    leg = float(posture.lengths[model.THIGH] + posture.lengths[model.SHIN])
    if float(posture.position[1]) > _SEATED_HIP_RATIO * leg:
        return sure
    trunk = posture.joints()[Joint.SHOULDER_CENTER] - posture.position
    if float(trunk[1]) < _UPRIGHT_COSINE * float(np.linalg.norm(trunk)):
        return sure
    return np.where(_IS_LEG, np.minimum(sure, _MAX_SEATED_LEG), sure)


@njit(cache=True, nogil=True)
def _logistic(evidence, weights):
    """Computes (J,) the logistic function of (J, F) evidence times weights, for :func:`joint_confidences`."""
    out = np.empty(len(evidence))
    for j in range(len(evidence)):
        score = 0.0
        for f in range(evidence.shape[1]):
            score += evidence[j, f] * weights[j, f]
        likely = 1.0 / (1.0 + np.exp(-min(30.0, max(-30.0, score))))
        out[j] = 0.0 if evidence[j, _OUTSIDE_EVIDENCE] > _UNSEEN_FRACTION else likely
    return out


@cache
def _weights_of_joints(table_name: str) -> Float:
    """Returns the (20, 17) weights of the 17 kinds of evidence for each joint.

    The joints of a group have equal rows.
    """
    return np.ascontiguousarray(load_evidence_weights(table_name)[GROUP_OF_JOINT])


def load_evidence_weights(table_name: str) -> Float:
    """Returns (12, 17) weights ordered by :data:`GROUPS` and :data:`evidence.NAMES`."""
    text = files("enliven_edge.assets").joinpath("confidence.json").read_text()
    table = json.loads(text)[table_name]
    return np.array([[table[group][name] for name in NAMES] for group in GROUPS])
