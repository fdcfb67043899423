"""Finding a person's posture with no memory: several hypotheses are fitted, the best explanation wins."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking import model
from enliven_edge.tracking.fit import FitReport, Fitter
from enliven_edge.tracking.observation import Observation
from enliven_edge.tracking.posture import Posture
from enliven_edge.tracking.ranges import standing

_ARMS = (
    {"arm_raise": 0.12, "elbow": 0.2},
    {"arm_raise": 0.15, "arm_forward": 0.1, "elbow": 1.5},
    {"arm_raise": 1.4, "elbow": 0.1},
    {"arm_raise": 2.6, "elbow": 0.2},
)
"""Arms hanging, forearms forward, arms out, arms overhead."""
_LEFT_ARM = [model.UPPER_ARM_L, model.FOREARM_L]
_RIGHT_ARM = [model.UPPER_ARM_R, model.FOREARM_R]
_SIDE_YAW = 1.2
_REFINED = 3


def detect(fitter: Fitter, observation: Observation, eye: Float, height: float) -> tuple[Posture, FitReport]:
    """The posture that explains the observation best from scratch.

    Each hypothesis stands under the crown of the observed points, facing the sensor or turned to a side; a
    short coarse fit ranks them by energy, and the best three are refined.

    Args:
        eye: (3,) the sensor's position, world frame.
        height: metres, the person's height until it is measured.
    """
    coarse = []
    for start in _hypotheses(observation, eye, height):
        posture, report = fitter.fit(observation, start, iterations=8, width=0.25)
        coarse.append((report.energy, posture))
    coarse.sort(key=lambda pair: pair[0])
    loose = np.full(len(model.LENGTHS), 30.0)
    best: tuple[Posture, FitReport] | None = None
    for _, posture in coarse[:_REFINED]:
        fitted = fitter.fit(observation, posture, iterations=15, width=0.12, proportions=loose)
        refined = fitter.fit(observation, fitted[0], iterations=15, proportions=loose)
        if best is None or refined[1].energy < best[1].energy:
            best = refined
    assert best is not None
    return best


def quality(report: FitReport) -> float:
    """The share of the person that is explained less the share of the model that was seen through."""
    return report.explained - float(report.violated.mean())


def _hypotheses(observation: Observation, eye: Float, height: float) -> list[Posture]:
    """Standing postures under the crown: six ways to hold the arms facing the sensor, two to the sides."""
    size = _measured_height(observation, height)
    centre = np.median(observation.points, axis=0)
    facing = float(np.arctan2(eye[0] - centre[0], eye[2] - centre[2]))
    held = [standing(facing, **arms) for arms in _ARMS]
    held += [_one_raised(facing, limbs) for limbs in (_LEFT_ARM, _RIGHT_ARM)]
    held += [standing(facing + yaw) for yaw in (_SIDE_YAW, -_SIDE_YAW)]
    return [_under_crown(observation, rotations, size) for rotations in held]


def _one_raised(facing: float, limbs: list[int]) -> Float:
    """(13, 3, 3) one arm up and out, the other hanging."""
    rotations = standing(facing)
    rotations[limbs] = standing(facing, arm_raise=2.2, elbow=0.2)[limbs]
    return rotations


def _measured_height(observation: Observation, height: float) -> float:
    """The person's height from the floor to the crown, where both are seen and it is a likely one."""
    if observation.cut:
        return height
    stature = float(observation.crown[1]) + 0.01
    return stature if 0.85 * height < stature < 1.2 * height else height


def _under_crown(observation: Observation, rotations: Float, height: float) -> Posture:
    """A posture whose head's top, or raised hands, are at the top of the observed points."""
    posture = Posture(np.zeros(3), rotations, model.lengths_for_height(height))
    ends, radii = posture.capsules()
    tops = (ends[..., 1] + radii).max(1)
    highest = int(np.argmax(tops))
    centre = np.median(observation.points, axis=0)
    crown = observation.crown
    # A head is the crown's neighbour sideways; a raised hand is not.
    under = 0.5 * (crown[0] + centre[0]) if model.CAPSULES.frame[highest] == model.HEAD else centre[0]
    head = np.array([under, crown[1] - tops[highest], 0.0])
    behind_surface = 0.1
    away = centre - observation.view[4][:3, 3]
    away[1] = 0.0
    head[2] = centre[2]
    posture.position = head + behind_surface * away / max(1e-6, float(np.linalg.norm(away)))
    return posture
