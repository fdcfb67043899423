"""Redetection of a tracked person, spread over several frames, and the network's estimates for it."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.arrays import Bool, Float
from enliven_edge.tracking.body_model import Posture
from enliven_edge.tracking.detect import (
    EstimateAtPoints,
    align_to_estimate,
    detect_another,
    estimate_at_points,
    estimates_by_facing,
    facing,
    flip_posture,
)
from enliven_edge.tracking.estimator import shipped_estimator
from enliven_edge.tracking.fit import FitReport, Fitter
from enliven_edge.tracking.frame import FrameView, Observation, observe
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import BudgetedTask, Steps


@dataclass(frozen=True)
class Redetection:
    """A detection from scratch, in progress, of a person that is already tracked.

    Attributes:
        task: the detection.
        observation, seen: the frame in which the detection began, and the network's estimate of it.
        posture, cost: of the ordinary fit to that frame.
        known: whether the person's build was known.
    """

    task: BudgetedTask[tuple[Posture, FitReport] | None]
    observation: Observation
    seen: EstimateAtPoints | None
    posture: Posture
    cost: float
    known: bool


def start_detection(
    fitter: Fitter,
    observation: Observation,
    seen: EstimateAtPoints | None,
    eye: Float,
    height: float,
    posture: Posture,
    lengths: Float | None,
) -> Steps[tuple[Posture, FitReport] | None]:
    """Runs the network for each likely facing, then :func:`detect_another`.

    It is a generator that yields its costs.

    The arguments are those of :func:`detect_another`.
    """
    by_facing = None
    if seen is not None:
        network, pose = shipped_estimator(), observation.view.world_from_camera
        by_facing = yield from estimates_by_facing(network, seen.estimate, pose)
    steps = detect_another(fitter, observation, seen, eye, height, posture, by_facing, lengths)
    return (yield from steps)


def create_observation(view: FrameView, pixels: Bool, settings: TrackerSettings) -> Observation:
    """Returns the observation of a person from its pixels."""
    return observe(view.z, view.points, pixels, view.camera, view.world_from_camera, settings.fit.points)


def run_network(
    view: FrameView, pixels: Bool, observation: Observation, facing: float | None
) -> EstimateAtPoints:
    """Runs the network on the (h, w) ``pixels``, conditioned on the facing in radians. None: unknown."""
    camera, pose = view.camera.camera, view.world_from_camera
    estimate = shipped_estimator().estimate(view.z, pixels, camera, pose, facing)
    return estimate_at_points(observation, estimate)


def add_guides(observation: Observation, seen: EstimateAtPoints, affinity: float) -> Observation:
    """Returns the observation with the network's affinities of its points and landmarks of the joints."""
    return observation.guided(seen.affinity(affinity), seen.estimate.guides)


def flip_with_estimate(
    posture: Posture, seen: EstimateAtPoints, view: FrameView
) -> tuple[Posture, EstimateAtPoints]:
    """Flips a posture by 180 degrees. Returns it with the network's estimate conditioned on that facing."""
    turned = flip_posture(posture)
    now = estimate_with_facing(turned, seen, view)
    return align_to_estimate(turned, now.estimate), now


def estimate_with_facing(posture: Posture, seen: EstimateAtPoints, view: FrameView) -> EstimateAtPoints:
    """Runs the network on the same crop again, conditioned on the facing of a posture."""
    facings: list[float | None] = [facing(posture, view.eye)]
    return seen.of(shipped_estimator().estimates(seen.estimate.crop, view.world_from_camera, facings)[0])
