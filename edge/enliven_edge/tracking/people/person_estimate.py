"""The observation of one person, and the network's estimates for it."""

from __future__ import annotations

from enliven.arrays import Bool
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect.appearance import (
    EstimateAtPoints,
    chest_facing,
    estimate_at_points,
    flip_posture,
)
from enliven_edge.tracking.detect.hypotheses import align_to_estimate
from enliven_edge.tracking.estimator.estimator import load_shipped_estimator
from enliven_edge.tracking.frame.observation import FrameView, Observation, observe_person
from enliven_edge.tracking.settings import TrackerSettings


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
    """Returns the flipped posture, see :func:`flip_posture`, and the network's estimate of the same crop for
    its facing.
    """
    turned = flip_posture(posture)
    facings: list[float | None] = [chest_facing(turned, view.eye)]
    crop = network_output.estimate.crop
    (estimate,) = load_shipped_estimator().estimates(crop, view.world_from_camera, facings)
    return align_to_estimate(turned, estimate), network_output.with_estimate(estimate)
