"""What performers did, as a tracker measured it: the take of a possession."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from enliven.arrays import AnyArray, Float, Int
from enliven.errors import InputError
from enliven.person import Body, Joint

_LONGEST = 1e7
"""Seconds that a take may last, 115 days: what lies beyond is a damaged clock."""


@dataclass(frozen=True, eq=False)
class BodyTake:
    """The joints of performers over time. Like every take it never changes.

    Attributes:
        id: its name in the project.
        seconds: (F,) float64, rising from 0.
        people: (B,) int64 ids of the performers.
        joints: (F, B, 20, 3) float64 metres, world frame; 0 for a performer who is not in view.
        confidence: (F, B, 20) float64 in [0, 1].
        present: (F, B) bool, who is in view.

    Raises:
        InputError: where the arrays do not fit together or are not finite.
    """

    id: str
    seconds: Float
    people: Int
    joints: Float
    confidence: Float
    present: AnyArray

    def __post_init__(self) -> None:
        kinds = {"seconds": np.float64, "people": np.int64, "joints": np.float64, "confidence": np.float64}
        for name, kind in {**kinds, "present": np.bool_}.items():
            array = np.array(getattr(self, name), kind)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        problem = _problem_of(self)
        if problem:
            raise InputError(problem, where=f"take {self.id!r}", mend="Record it again.")

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return float(self.seconds[-1])

    def bodies(self, frame: int) -> list[Body]:
        """Returns the performers in view in a frame, in the order of :attr:`people`."""
        return [
            Body(int(self.people[i]), self.joints[frame, i], self.confidence[frame, i])
            for i in np.flatnonzero(self.present[frame])
        ]


@dataclass(frozen=True)
class HoldChange:
    """A performer takes hold of a character, or lets go, at a moment of a take.

    Attributes:
        seconds: of the take.
        performer: the id; None: the first in view, and for "release" all.
        parts: the parts of the body that take hold: "all", "legs", "upper body", ...
        mode: "alone" ends all other holds, "join" keeps those of other performers, "extend" keeps the
            performer's own too, "release" lets go.
    """

    seconds: float
    performer: int | None = None
    parts: str = "all"
    mode: Literal["alone", "join", "extend", "release"] = "alone"


def _problem_of(take: BodyTake) -> str:
    frames, people, joints = len(take.seconds), len(take.people), len(Joint)
    shapes = (take.joints.shape, take.confidence.shape, take.present.shape)
    if frames == 0 or people == 0:
        return "it has no frames or no performers"
    if shapes != ((frames, people, joints, 3), (frames, people, joints), (frames, people)):
        return f"joints {shapes[0]}, confidence {shapes[1]}, present {shapes[2]}"
    if len(set(take.people.tolist())) != people:
        return "two performers have one id"
    if not (np.isfinite(take.joints).all() and np.isfinite(take.seconds).all()):
        return "something in it is not finite"
    if not ((take.confidence >= 0.0) & (take.confidence <= 1.0)).all():
        return "a confidence is not between 0 and 1"
    if take.seconds[0] != 0.0 or (np.diff(take.seconds) <= 0.0).any() or take.seconds[-1] > _LONGEST:
        return "its times do not rise from 0"
    return ""
