"""Who is known for a person though their shape does not convince: with raised arms beside the head, say."""

from __future__ import annotations

from collections.abc import Iterable

from enliven.arrays import Bool
from enliven_edge.tracking.estimator import shipped_estimator
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.segment import Candidate
from enliven_edge.tracking.work_budget import LOOK, Budget

_RECOGNISED = 0.97
"""Probability from which the network knows a person."""


def likelihood(view: FrameView, pixels: Bool) -> float:
    """How likely the network finds it that the (h, w) pixels are one person, in [0, 1]."""
    camera, pose = view.camera.camera, view.world_from_camera
    return shipped_estimator().estimate(view.z, pixels, camera, pose, None).somebody


def recognise(newcomers: Iterable[Candidate], view: FrameView, budget: Budget) -> None:
    """Asks the network about those whose shape does not convince, now and then, as far as the budget goes."""
    for newcomer in newcomers:
        if budget.left > 0.0 and newcomer.needs_recognition(view.time_ns):
            newcomer.recognised = likelihood(view, newcomer.pixels) > _RECOGNISED
            budget.left -= LOOK
