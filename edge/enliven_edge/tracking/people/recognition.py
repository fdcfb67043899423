"""The network's verdict on groups of pixels that are not shaped as people are when they stand."""

from __future__ import annotations

from collections.abc import Iterable

from enliven.arrays import Bool
from enliven_edge.tracking.estimator import shipped_estimator
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.segment import Candidate
from enliven_edge.tracking.work_budget import LOOK, Budget

_RECOGNISED = 0.97
"""Probability from which the network's verdict outweighs the shape: of things found by mistake 95 % stay
below 0.43."""


def likelihood(view: FrameView, pixels: Bool) -> float:
    """Returns the probability in [0, 1], by the network, that the (h, w) pixels are one person."""
    camera, pose = view.camera.camera, view.world_from_camera
    return shipped_estimator().estimate(view.z, pixels, camera, pose, None).person_probability


def recognise(newcomers: Iterable[Candidate], view: FrameView, budget: Budget) -> None:
    """Runs the network now and then on newcomers of a doubtful shape, as far as the budget goes."""
    for newcomer in newcomers:
        if budget.left > 0.0 and newcomer.needs_recognition(view.time_ns):
            newcomer.recognised = likelihood(view, newcomer.pixels) > _RECOGNISED
            budget.left -= LOOK
