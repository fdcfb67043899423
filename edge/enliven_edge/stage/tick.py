"""The complete result of one frame, for viewers, the take and the physics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from enliven.document import Pose, Props
from enliven.frames import Frame
from enliven.matching.match_list import MatchList
from enliven.person import Body
from enliven.possession import Cues
from enliven.wire import HoldMessage


@dataclass(frozen=True)
class Tick:
    """The complete result of one frame.

    Attributes:
        frame: the sensor's frame.
        bodies: all performers in view, world frame.
        poses: the poses, one for each character.
        read_ns: time at which the frame was read, nanoseconds of the monotonic clock; 0 if unknown.
        cues: by character id, the nodes that performers hold, or would hold if they possessed it now.
        boards: for each rigged character, the list of matches to choose from.
        holders: the ids of the performers who possess a character.
        holds: changes of the holds since the previous frame.
        props: the rigid bodies of the physics simulation, if it runs.
    """

    frame: Frame
    bodies: list[Body] = field(default_factory=list)
    poses: Sequence[Pose] = ()
    read_ns: int = 0
    cues: Mapping[str, Cues] = field(default_factory=dict)
    boards: Sequence[MatchList] = ()
    holders: frozenset[int] = frozenset()
    holds: Sequence[HoldMessage] = ()
    props: Props | None = None

    @property
    def time_ns(self) -> int:
        """Returns the frame's time in nanoseconds of the sensor's clock."""
        return self.frame.time_ns
