"""Props, spheres and bodies for the physics tests, which are skipped if the engine is not installed."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the physics engine is an extra: pip install ./edge[physics]")

from enliven.document.props import BALL, BOX
from enliven.person.body import Body
from enliven_edge.physics.settings import EngineSettings
from enliven_edge.physics.world import PropSpecs, World
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.model import lengths_for_height
from enliven_edge.tracking.body_model.posture import Posture

FRAME = 1 / 30
UNBOUND = EngineSettings(budget=0.0)
"""Settings with an unlimited time budget, so that results do not depend on the wall clock."""


def boxes(count: int = 1, side: float = 0.2, mass: float = 0.4) -> PropSpecs:
    """Returns boxes of one size."""
    return PropSpecs(
        np.full(count, BOX, np.uint8),
        np.full((count, 3), side / 2),
        np.full(count, mass),
        np.zeros((count, 3), np.uint8),
        np.zeros(count),
    )


def balls(count: int = 1, radius: float = 0.1, bounce: float = 0.0) -> PropSpecs:
    """Returns balls of one size."""
    return PropSpecs(
        np.full(count, BALL, np.uint8),
        np.full((count, 3), radius),
        np.full(count, 0.25),
        np.zeros((count, 3), np.uint8),
        np.full(count, bounce),
    )


def pushed(speed: float, way: tuple[float, float, float] = (1, 0, 0), frames: int = 30) -> World:
    """Returns a world in which one sphere was moved past a box in the direction ``way``."""
    world = World(boxes(), UNBOUND)
    world.set_state(slice(None), np.array([[0.0, 0.1, 0.0]]))
    along = np.array(way, float)
    for k in range(frames):
        centre = np.array([0.0, 0.12, 0.0]) + min(-0.4 + speed * k * FRAME, 0.1) * along
        world.move(centre[None], np.array([0.06]))
        assert world.advance(FRAME) == ""
    return world


def person(at: tuple[float, float] = (0.0, 0.0), number: int = 1, lean: float = 0.0) -> Body:
    """Returns a person of 1.75 m that stands upright."""
    posture = Posture(
        np.array([at[0] + lean, 0.95, at[1]]), standing_pose(elbow=1.5), lengths_for_height(1.75)
    )
    return Body(number, posture.joints(), np.ones(20))
