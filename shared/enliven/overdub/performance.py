"""A performance, live or recorded: the motion of performers and of the characters that they moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from enliven.document import Character, Pose, Project, unused
from enliven.frames import BodyFrame
from enliven.motion_clips.body_takes import RecordedHolds, holds_from_frames
from enliven.motion_clips.merged_performers import MergedPerformers
from enliven.overdub.punch_in import PunchIn
from enliven.wire import HoldMessage

_MIN_POSES = 2
"""Minimum number of recorded poses of a character that was performed."""
MIN_MOTION = 0.005
"""Minimum change, in metres or in entries of a rotation matrix, that counts as motion. It is ten times the
quantization step of transmitted poses."""

Key = tuple[str, int]
"""The id and the revision of a character."""


@dataclass
class PerformedMotion:
    """The motion of performers and characters over a period.

    Attributes:
        name: name of the takes that are created from the motion.
        since_ns: start time, nanoseconds of the sensor's clock. Frames and attachments may begin earlier.
        frames: frames with tracked performers, in the order of time.
        events: events of performers who attach to or release characters, in the order of time.
        characters: the characters by id and revision.
        poses: the poses of each character, ordered by time.
    """

    name: str
    since_ns: int = 0
    frames: list[BodyFrame] = field(default_factory=list)
    events: list[HoldMessage] = field(default_factory=list)
    characters: dict[Key, Character] = field(default_factory=dict)
    poses: dict[Key, list[Pose]] = field(default_factory=dict)

    def cut_at(self, time_ns: int) -> PerformedMotion:
        """Returns the part of the performance up to a time of the sensor's clock, nanoseconds."""
        poses = {
            key: [pose for pose in track if pose.time_ns <= time_ns] for key, track in self.poses.items()
        }
        return replace(
            self,
            frames=[frame for frame in self.frames if frame.time_ns <= time_ns],
            events=[event for event in self.events if event.time_ns <= time_ns],
            poses={key: track for key, track in poses.items() if track},
        )

    @property
    def moved_characters(self) -> list[Key]:
        """The characters that moved."""
        return [key for key, poses in self.poses.items() if len(poses) >= _MIN_POSES and _is_moving(poses)]


@dataclass(frozen=True)
class PerformedCharacter:
    """The performance of one character.

    Attributes:
        key: its id and revision on the stage.
        performed: the whole performance.
        merged: the performers after re-identification, with one id per person.
        begin: time of the sensor's clock at 0 seconds of the project, nanoseconds.
        replaces: True if the performance replaces the earlier motion between its begin and its end.
    """

    key: Key
    performed: PerformedMotion
    merged: MergedPerformers
    begin: int
    replaces: bool

    @property
    def character(self) -> Character:
        """The version of the character that was on the stage."""
        return self.performed.characters[self.key]

    @property
    def poses(self) -> list[Pose]:
        """Its poses, ordered by time."""
        return self.performed.poses[self.key]

    def span(self, project: Project) -> PunchIn:
        """Returns the time span of the motion, in seconds of the project."""
        first, last = (1e-9 * (pose.time_ns - self.begin) for pose in (self.poses[0], self.poses[-1]))
        return PunchIn.from_interval(project, first, last)

    def holds(self, project: Project) -> RecordedHolds | None:
        """Returns the performers and their attachments, with an id that the project does not use yet."""
        performed = self.performed
        return holds_from_frames(performed.frames, performed.events, unused(performed.name, project.bodies))


def _is_moving(poses: Sequence[Pose]) -> bool:
    first_pose = poses[0]
    return any(
        max(
            np.abs(pose.positions - first_pose.positions).max(), np.abs(pose.linear - first_pose.linear).max()
        )
        > MIN_MOTION
        for pose in poses
    )
