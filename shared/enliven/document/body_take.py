"""Takes of tracked performer bodies, and the record of how performers possessed (attached to and moved) a
mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from enliven.arrays import AnyArray, Float, Int
from enliven.errors import InputError
from enliven.person import Body, Joint

HoldMode = Literal["alone", "join", "extend", "release", "take over", "remove"]
"""Effect of a :class:`HoldChange` on the attachments (holds) of a character."""
_MAX_TAKE_S = 1e7
"""Maximum duration of a take in seconds: 115 days. A longer take indicates an error of the clock."""


@dataclass(frozen=True, eq=False)
class BodyTake:
    """The joints of performers over time. Like every take it is immutable.

    Attributes:
        id: its name in the project.
        seconds: (F,) float64 times of the frames, increasing from 0.
        people: (B,) int64 ids of the performers.
        joints: (F, B, 20, 3) float64 metres, world frame. 0 for a performer who is not in view.
        confidence: (F, B, 20) float64 in [0, 1].
        present: (F, B) bool, true for performers in view.
        stature: (F, B) body height from soles to crown, metres, or 0 if it was not measured. None if it was
            never measured.

    Raises:
        InputError: if the shapes of the arrays are inconsistent or values are not finite.
    """

    id: str
    seconds: Float
    people: Int
    joints: Float
    confidence: Float
    present: AnyArray
    stature: Float | None = None

    def __post_init__(self) -> None:
        kinds = {"seconds": np.float64, "people": np.int64, "joints": np.float64, "confidence": np.float64}
        for name, kind in {**kinds, "present": np.bool_, "stature": np.float64}.items():
            if getattr(self, name) is not None:
                array = np.array(getattr(self, name), kind)
                array.setflags(write=False)
                object.__setattr__(self, name, array)
        problem = _describe_problem(self)
        if problem:
            raise InputError(problem, where=f"take {self.id!r}", remedy="Record the take again.")

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return float(self.seconds[-1])

    def bodies(self, frame: int) -> list[Body]:
        """Returns the performers in view in a frame, in the order of :attr:`people`."""
        tall = np.zeros(len(self.people)) if self.stature is None else self.stature[frame]
        return [
            Body(
                int(self.people[i]),
                self.joints[frame, i],
                self.confidence[frame, i],
                stature=float(tall[i]) or None,
            )
            for i in np.flatnonzero(self.present[frame])
        ]


@dataclass(frozen=True)
class HoldChange:
    """An event of a take: a performer attaches to a character, or releases it.

    A change is applied after the frame at its time. The exception is "take over", which is applied before
    this frame.

    Attributes:
        seconds: time of the event in the take.
        performer: the id of the performer. None means the first performer in view or, for "release", all
            performers.
        parts: the parts of the body that attach: "all", "legs", "upper body", ...
        mode: "alone" detaches all other performers. "join" keeps other performers attached. "extend" also
            keeps the performer's earlier attachment. "release" detaches the performer. "take over" transfers
            the attachment of ``former`` to the performer. "remove" removes the character from the stage.
        former: for "take over", the id of the absent performer.
    """

    seconds: float
    performer: int | None = None
    parts: str = "all"
    mode: HoldMode = "alone"
    former: int | None = None


@dataclass(frozen=True, eq=False)
class Possession:
    """A record of the performance that moved a mesh. It contains all inputs for solving the motion again, for
    this mesh or another mesh.

    Attributes:
        take: the id of the performers' take.
        holds: the events of attaching and releasing, in the order of time.
        settings: the settings of the actor, as JSON.
        height: height of the mesh at rest during the recording, metres, which determined its placement. 0
            means its current height.
        size: scale: metres of the mesh as modelled per metre of its rest space.
        place: placement of the waiting mesh: scale, radians about +Y, x, y, z in metres. If empty, the
            settings determine the placement.
        start, end: range of the take that is played, seconds; an end of 0 means the end of the take.
        rest: (N, 3) metres, the nodes at rest when the motion was solved or recorded.
        solved: a checksum of the inputs of the solution. Empty if the motion was not solved yet.
    """

    take: str
    holds: tuple[HoldChange, ...]
    settings: str = "{}"
    height: float = 0.0
    size: float = 1.0
    place: tuple[float, ...] = ()
    start: float = 0.0
    end: float = 0.0
    rest: Float = field(default_factory=lambda: np.zeros((0, 3)))
    solved: str = ""

    def __post_init__(self) -> None:
        rest = np.array(self.rest, np.float64)
        rest.setflags(write=False)
        object.__setattr__(self, "rest", rest)
        sizes = [self.size, *self.place[:1]]
        is_valid = rest.ndim == 2 and rest.shape[1] == 3 and len(self.place) in (0, 5) and min(sizes) > 0.0
        if not (is_valid and np.isfinite([*self.place, *sizes, self.height, self.start, self.end]).all()):
            problem = (
                f"the recorded possession has invalid data: node array {rest.shape}, placement "
                f"{self.place}, scale {self.size}"
            )
            raise InputError(problem, where=f"take {self.take!r}", remedy="Record the take again.")

    def last(self, take: BodyTake) -> float:
        """Returns the time of the take, in seconds, at which the played part ends."""
        return self.end if self.end > 0.0 else take.duration


def _describe_problem(take: BodyTake) -> str:
    frames, people, joints = len(take.seconds), len(take.people), len(Joint)
    shapes = (take.joints.shape, take.confidence.shape, take.present.shape)
    if frames == 0 or people == 0:
        return "the take has no frames or no performers"
    if shapes != ((frames, people, joints, 3), (frames, people, joints), (frames, people)):
        return (
            f"the arrays of the take have wrong shapes: joints {shapes[0]}, confidence "
            f"{shapes[1]}, present {shapes[2]}"
        )
    if take.stature is not None and (take.stature.shape != shapes[2] or not (take.stature >= 0.0).all()):
        return "the height of a performer is negative or missing"
    if len(set(take.people.tolist())) != people:
        return "two performers of the take have the same id"
    if not (np.isfinite(take.joints).all() and np.isfinite(take.seconds).all()):
        return "a joint position or a time of the take is not a finite number"
    if not ((take.confidence >= 0.0) & (take.confidence <= 1.0)).all():
        return "a confidence value of the take is not between 0 and 1"
    if take.seconds[0] != 0.0 or (np.diff(take.seconds) <= 0.0).any() or take.seconds[-1] > _MAX_TAKE_S:
        return "the times of the take do not increase from 0 s"
    return ""
