"""A fourth kind of rig on a stage: performers move the corners of a cage with their hands and feet.

Importing this module registers the actor of a cage, and the recording of its motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from cage import Cage, CageRig, Swing

from enliven.arrays import Float
from enliven.document import Pose, PoseStream, Project, unused
from enliven.modeling.possessed.even_steps import even_times, interpolate_linearly
from enliven.overdub.performance import PerformedCharacter
from enliven.overdub.performance_takes import RECORDERS
from enliven.person import Body, Joint
from enliven.possession import Actor, Cues, make_cues
from enliven_edge.uploaded_actor import ACTORS, Upload

JOINTS = (Joint.WRIST_RIGHT, Joint.WRIST_LEFT, Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT)
"""The joint that moves each corner."""


@dataclass
class Grip:
    """A performer that moves the corners. ``start``: (4, 3) metres, the joints at the beginning."""

    body: int
    start: Float


@dataclass(frozen=True)
class CageSettings:
    """A cage has no settings."""


class CageActor(Actor):
    """An actor for a cage whose corners follow performers' joints."""

    def __init__(self, project: Project, cage: Cage) -> None:
        self.character = CageRig().make_drawing(cage)
        self.holds: list[Grip] = []
        self.settings = CageSettings()
        self._linear = np.tile(cage.linear.astype(np.float32), (4, 1, 1))
        self._corners = CageRig().corners_at(project, cage, 0.0)
        self._offsets = np.zeros((4, 3))

    def perform(self, bodies: list[Body], time_ns: int, seen: Mapping[int, Any] | None = None) -> Pose:
        joints = {body.id: body.joints[list(JOINTS)] for body in bodies}
        for grip in self.holds:
            if grip.body in joints:
                self._offsets = joints[grip.body] - grip.start
        positions = (self._corners + self._offsets).astype(np.float32)
        return Pose(self.character.id, time_ns, self._linear, positions)

    def possess(self, body: Body, parts: str = "all", mode: str = "alone") -> None:
        self.holds = [Grip(body.id, np.array(body.joints[list(JOINTS)]))]

    def release(self, body: int | None = None) -> None:
        self._require_holder(body, ("hold", "held"))
        self.holds = []

    def cues(self, bodies: list[Body]) -> Cues:
        return make_cues([(grip.body, np.ones(4)) for grip in self.holds], None)

    def warm_up(self) -> None:
        pass


def add_swing(project: Project, cage: Cage, motion: PerformedCharacter) -> Project | None:
    """Adds the recorded motion of the corners as a layer."""
    poses, seconds, grid = even_times(motion.character, motion.poses, motion.begin)
    corners = interpolate_linearly(np.array([pose.positions for pose in poses], np.float64), seconds, grid)
    offsets = (corners - corners[0]) @ np.linalg.inv(cage.linear).T
    name = unused(f"{motion.performed.name} on {cage.id}", project.streams)
    linear = np.tile(np.eye(3), (len(grid), 4, 1, 1))
    stream = PoseStream(name, linear, offsets, float(grid[1] - grid[0]))
    layer = Swing(name, offset=float(grid[0]))
    return project.with_streams(stream).with_characters(cage.with_changes(layers=(*cage.layers, layer)))


def _create_actor(upload: Upload) -> CageActor:
    return CageActor(upload.project, upload.character)


ACTORS[Cage.kind] = _create_actor
RECORDERS[Cage.kind] = add_swing
