"""Redetection of a tracked person, spread over several frames, and the network's estimates for it."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.arrays import Bool, Float
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect.appearance import (
    EstimateAtPoints,
    chest_facing,
    estimate_at_points,
    flip_posture,
)
from enliven_edge.tracking.detect.detection import detect_another, estimates_by_facing
from enliven_edge.tracking.detect.hypotheses import align_to_estimate
from enliven_edge.tracking.estimator.estimator import load_shipped_estimator
from enliven_edge.tracking.fit.fit import FitReport, Fitter
from enliven_edge.tracking.frame.observation import FrameView, Observation, observe_person
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import BudgetedTask, Steps


@dataclass(frozen=True)
class Redetection:
    """A detection from scratch, in progress, of a person who is already tracked.

    Attributes:
        task: the detection, which runs step by step.
        observation, network_output: the observation in the frame in which the detection began, and the
            network's estimate for it.
        posture, cost: the ordinary fit to that frame, and its cost.
        known: whether the person's bone lengths were known.
    """

    task: BudgetedTask[tuple[Posture, FitReport] | None]
    observation: Observation
    network_output: EstimateAtPoints | None
    posture: Posture
    cost: float
    known: bool


def start_detection(
    fitter: Fitter,
    observation: Observation,
    network_output: EstimateAtPoints | None,
    eye: Float,
    height: float,
    posture: Posture,
    lengths: Float | None,
) -> Steps[tuple[Posture, FitReport] | None]:
    """Runs the network for each likely facing, then :func:`detect_another`. A generator that yields the
    costs.

    The arguments are those of :func:`detect_another`.
    """
    by_facing = None
    if network_output is not None:
        network, pose = load_shipped_estimator(), observation.view.world_from_camera
        by_facing = yield from estimates_by_facing(network, network_output.estimate, pose)
    steps = detect_another(fitter, observation, network_output, eye, height, posture, by_facing, lengths)
    return (yield from steps)


def create_observation(view: FrameView, pixels: Bool, settings: TrackerSettings) -> Observation:
    """Returns the observation of a person from its pixels."""
    return observe_person(
        view.z, view.points, pixels, view.camera, view.world_from_camera, settings.fit.points
    )


def run_network(
    view: FrameView, pixels: Bool, observation: Observation, facing: float | None
) -> EstimateAtPoints:
    """Runs the network on the (h, w) ``pixels``, conditioned on the facing in radians, or on None if it is
    unknown.
    """
    camera, pose = view.camera.camera, view.world_from_camera
    estimate = load_shipped_estimator().estimate(view.z, pixels, camera, pose, facing)
    return estimate_at_points(observation, estimate)


def add_guides(observation: Observation, network_output: EstimateAtPoints, affinity: float) -> Observation:
    """Returns the observation with affinities of its points and landmarks of its joints, both from the
    network.
    """
    return observation.with_guides(network_output.affinity(affinity), network_output.estimate.weak_landmarks)


def flip_with_estimate(
    posture: Posture, network_output: EstimateAtPoints, view: FrameView
) -> tuple[Posture, EstimateAtPoints]:
    """Returns the flipped posture, see :func:`flip_posture`, and the network's estimate for its facing."""
    turned = flip_posture(posture)
    estimate = estimate_with_facing(turned, network_output, view)
    return align_to_estimate(turned, estimate.estimate), estimate


def estimate_with_facing(
    posture: Posture, network_output: EstimateAtPoints, view: FrameView
) -> EstimateAtPoints:
    """Runs the network on the same crop again, conditioned on the facing of a posture."""
    facings: list[float | None] = [chest_facing(posture, view.eye)]
    return network_output.with_estimate(
        load_shipped_estimator().estimates(network_output.estimate.crop, view.world_from_camera, facings)[0]
    )
