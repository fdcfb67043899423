"""The result of one frame as one value: what viewers, the take and the physics are told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from enliven.document import Pose, Props
from enliven.frames import Frame
from enliven.matching import Board
from enliven.person import Body
from enliven.possession import Cues
from enliven.wire import HoldMessage


@dataclass(frozen=True)
class Tick:
    """Everything that one frame led to.

    Attributes:
        frame: the sensor's.
        bodies: all performers in view, world frame.
        poses: one for each character.
        read_ns: wall clock when the frame was read; 0 where that is not known.
        cues: by character id, the nodes that are held, or would be.
        boards: the matches to choose from, of each rigged character.
        holders: the ids of the performers who hold a character.
        holds: changes of who holds what, since the frame before.
        props: the loose things among them, where there are physics.
    """

    frame: Frame
    bodies: list[Body] = field(default_factory=list)
    poses: Sequence[Pose] = ()
    read_ns: int = 0
    cues: Mapping[str, Cues] = field(default_factory=dict)
    boards: Sequence[Board] = ()
    holders: frozenset[int] = frozenset()
    holds: Sequence[HoldMessage] = ()
    props: Props | None = None

    @property
    def time_ns(self) -> int:
        """Nanoseconds, the sensor's clock."""
        return self.frame.time_ns
