"""Images of people that were not used for training, with ground truth, and scenes of noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from enliven.person.limbs import Limb
from enliven_edge.tracking.estimator.estimator import Estimate, load_shipped_estimator
from enliven_edge.tracking.estimator.labels import facing_in_plan
from enliven_synthesis.training.rendering import PersonRenderer, RenderedPerson

_DICE = 2024
"""A random seed that no training set uses."""


@dataclass(frozen=True)
class Fresh:
    """One image with its ground truth.

    Attributes:
        picture: the rendered image.
        z: (h, w) measured depth, metres.
        mask: (h, w) True on the person's pixels.
        facing: true facing, radians.
    """

    picture: RenderedPerson
    z: np.ndarray
    mask: np.ndarray
    facing: float

    def estimate(self, told: bool) -> Estimate:
        """Returns the shipped network's estimates, with or without the facing as input."""
        taken = self.picture
        facing = self.facing if told else None
        return load_shipped_estimator().estimate(
            self.z, self.mask, taken.camera, taken.world_from_camera, facing
        )


@cache
def fresh(number: int, frontal: float = 0.4) -> Fresh:
    """Returns the image with a number."""
    taken = _studio().render_person(np.random.default_rng([_DICE, number]), frontal=frontal)
    mask = taken.z > 0
    chest = taken.figure.frames[Limb.CHEST]
    facing = facing_in_plan(chest[:, 0], chest[:, 3], taken.world_from_camera[:3, 3])
    return Fresh(taken, np.where(mask, taken.z, taken.around).astype(np.float64), mask, facing)


@cache
def _studio() -> PersonRenderer:
    return PersonRenderer()


def turned_at_random(dice: np.random.Generator) -> np.ndarray:
    """Returns a (3, 3) rotation that is uniformly distributed."""
    basis, _ = np.linalg.qr(dice.normal(size=(3, 3)))
    return basis * np.linalg.det(basis)


def scene(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Returns (z, mask, camera, world_from_camera) of a blob among noise, seen by a sensor at a random tilt.

    The blob has fewer than 500 pixels, so that all of them are used when its position is estimated.
    """
    dice = np.random.default_rng(seed)
    shape, middle, reach = (40, 50), dice.uniform(12, 28, 2), dice.uniform(2, 11, 2)
    v, u = np.indices(shape)
    mask = ((v - middle[0]) / reach[0]) ** 2 + ((u - middle[1]) / reach[1]) ** 2 < 1
    away = dice.uniform(0.8, 4.0)
    z = np.where(mask, away + dice.normal(0, 0.1, shape), away + dice.normal(0, 0.5, shape))
    z = np.maximum(z, 0.3) * (dice.random(shape) > 0.1)
    camera = np.array([dice.uniform(30, 90), dice.uniform(30, 90), *dice.uniform(15, 30, 2)])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turned_at_random(dice), dice.normal(size=3)
    return z, mask & (z > 0), camera, pose
