"""People at 2.8 m from the sensor in postures of every class, and the network's estimates of them.

The figures are fixed by their seeds, which differ from those used for training.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from enliven.camera import Intrinsics, world_from_level_camera
from enliven_edge.tracking.detect.appearance import EstimateAtPoints, estimate_at_points
from enliven_edge.tracking.detect.detection import estimates_by_facing
from enliven_edge.tracking.estimator.estimator import Estimate, load_shipped_estimator
from enliven_edge.tracking.frame.observation import Observation, WorkingCamera, observe_person, world_points
from enliven_edge.tracking.work_budget import run_to_end
from enliven_synthesis.body.performer import Figure, Performer
from enliven_synthesis.training.body_poses import random_figure
from enliven_synthesis.training.rendering import PersonRenderer, RenderedPerson, random_build

CLASSES = {
    "arms overhead": ("stand", "overhead", 0.0),
    "hands to the floor": ("bow", "hang", 0.0),
    "crouching": ("crouch", None, 0.0),
    "kneeling": ("kneel", None, 0.0),
    "side": ("stand", "hang", 1.5),
    "back": ("stand", "hang", np.pi),
    "one leg up": ("one leg", None, 0.0),
}
"""Posture family, arm pose and yaw by class."""
SEEDS = (900, 901, 902)


@cache
def _studio() -> PersonRenderer:
    return PersonRenderer()


@cache
def taken(name: str, seed: int) -> RenderedPerson:
    """Returns the image of a person."""
    family, arms, yaw = CLASSES[name]
    dice = np.random.default_rng([41, seed])
    performer = Performer(random_build(dice))
    figure = random_figure(performer, dice, yaw + dice.normal(0, 0.2), family, arms)
    middle = 0.5 * (figure.joints.min(0) + figure.joints.max(0))
    pose = world_from_level_camera(1.2, np.arctan2(1.2 - middle[1], 2.8))
    pose[:3, 3] = middle[0], 1.2, middle[2] + 2.8
    return _studio().render_figure(performer, figure, seed % 6, pose, dice)


@cache
def seen_person(name: str, seed: int) -> tuple[Observation, Figure]:
    """Returns a person in a room, and the ground truth."""
    picture = taken(name, seed)
    mask, pose = picture.z > 0, picture.world_from_camera
    z = np.where(mask, picture.z, picture.around).astype(np.float64)
    camera = WorkingCamera(Intrinsics(z.shape[1], z.shape[0], *picture.camera), z.shape[1])
    return observe_person(z, world_points(z, camera.ray, pose), mask, camera, pose, 900), picture.figure


def seen_in(observation: Observation, facing: float | None = None) -> tuple[EstimateAtPoints, list[Estimate]]:
    """Returns the shipped network's estimate of an observation, and its estimates by facing."""
    z, mask, _, camera, pose = observation.view
    estimate = load_shipped_estimator().estimate(z, mask, camera, pose, facing)
    return estimate_at_points(observation, estimate), run_to_end(
        estimates_by_facing(load_shipped_estimator(), estimate, pose)
    )
