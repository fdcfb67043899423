"""The result of one frame as one value, for viewers, the take and the physics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from enliven.document import Pose, Props
from enliven.frames import Frame
from enliven.matching import MatchList
from enliven.person import Body
from enliven.possession import Cues
from enliven.wire import HoldMessage


@dataclass(frozen=True)
class Tick:
    """Everything that results from one frame.

    Attributes:
        frame: the sensor's frame.
        bodies: all performers in view, world frame.
        poses: one for each character.
        read_ns: wall clock when the frame was read, in nanoseconds. 0 if it is not known.
        cues: by character id, the nodes that are held, or would be.
        boards: the matches to choose from, for each rigged character.
        holders: the ids of the performers that hold a character.
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
        """Nanoseconds, the sensor's clock."""
        return self.frame.time_ns
