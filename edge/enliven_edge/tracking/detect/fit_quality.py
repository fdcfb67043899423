"""How well a fitted posture explains its frame, and how odd it is."""

from __future__ import annotations

from enliven.arrays import Float
from enliven_edge.tracking.body_model import Posture, model
from enliven_edge.tracking.detect.appearance import (
    DISAGREEMENT,
    EstimateAtPoints,
    agreement,
    facing_score,
)
from enliven_edge.tracking.detect.facing_side import backward
from enliven_edge.tracking.fit import FitReport
from enliven_edge.tracking.frame import Observation

_FACING = 0.6
"""Square centimetres a point: cost of a less likely facing, for each unit of log probability."""
_BACKWARD = 12.0
"""Square centimetres a point: cost of leaning backward, times the sine: people bend forward."""
_STATURE = 2.0
"""Square centimetres a point: cost of the unlikeliest stature; less than of a posture that explains badly."""
_SPREAD = 0.15
"""Metres from the likeliest stature at which a third of that is paid: about two deviations of adults."""
_SHORTEST = 0.9
"""Metres: the least height of what is seen for it to be taken for a standing person's, a child's."""
_TALLEST = 2.1
"""Metres: the greatest height of what is seen for it to be a person's, and not raised arms."""
_ALIKE = 0.08
"""Share by which two statures may differ to be searched as one: 14 cm of 1.72 m, which a fit makes up for."""


def cost(
    report: FitReport, posture: Posture, seen: EstimateAtPoints | None, eye: Float, height: float
) -> float:
    """Returns the whole cost of a fitted posture, square centimetres a point; comparable within one frame."""
    return report.energy + oddness(seen, posture, eye, height)


def oddness(seen: EstimateAtPoints | None, posture: Posture, eye: Float, height: float) -> float:
    """Returns the cost of a posture without depth, square centimetres a point.

    It adds up points that the network takes for other parts, a facing that it does not see, leaning backward,
    and a stature far from the likeliest.
    """
    unlike = ((model.height_of(posture.lengths) - height) / _SPREAD) ** 2
    stature = _STATURE * unlike / (unlike + 2.0) + _BACKWARD * backward(posture)
    if seen is None:
        return stature
    facing = facing_score(seen, posture, eye)
    return stature + DISAGREEMENT * (1.0 - agreement(seen, posture)) - _FACING * facing


def quality(report: FitReport) -> float:
    """Returns the share of points explained less the share of the model seen through, up to 1."""
    return report.explained - float(report.violated.mean())


def likely_builds(observation: Observation, height: float) -> list[Float]:
    """Returns (12,) lengths of one or two builds: of the likeliest height, and of the height that is seen.

    A lower height may be a child's, or an adult's who crouches; a higher one a tall person's, or raised arms.
    """
    seen = float(observation.crown[1]) + 0.01
    if observation.cut or not _SHORTEST < seen < _TALLEST:
        return [model.lengths_for_height(height)]
    if abs(seen / height - 1.0) < _ALIKE:
        return [model.lengths_for_height(seen)]
    return [model.lengths_for_height(height), model.lengths_for_height(seen)]
