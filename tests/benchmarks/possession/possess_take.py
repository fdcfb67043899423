"""Runs bodies through the edge's own output and stage, frame by frame, without sockets, and stores the
result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from enliven.document.character import Character, Pose
from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven.possession.embedded_actor import EmbeddedActor
from enliven.possession.highlights import Cues
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.output.output import Output
from enliven_edge.tracking.settings import TrackerSettings


@dataclass(frozen=True)
class Act:
    """A request to attach a performer.

    Attributes:
        seconds: time after the take's first frame.
        parts: parts of the body.
        body: the performer's ID; None for the first one in view.
        mode: "alone", "join" or "extend".
    """

    seconds: float
    parts: str = "all"
    body: int | None = None
    mode: str = "alone"


@dataclass(frozen=True)
class Shot:
    """The result of one frame."""

    time_ns: int
    bodies: list[Body]
    pose: Pose
    cues: Cues


@dataclass
class Take:
    """A character and its performance.

    Attributes:
        held_ns: time at which each act was executed.
    """

    character: Character
    shots: list[Shot] = field(default_factory=list)
    held_ns: list[int] = field(default_factory=list)


def perform(
    frames: Sequence[BodyFrame],
    actor: EmbeddedActor,
    acts: Sequence[Act],
    tracker: TrackerSettings | None = None,
) -> Take:
    """Runs every frame through the edge."""
    output, stage, name = Output(tracker), Stage([actor]), actor.character.id
    take, waiting = Take(actor.character), sorted(acts, key=lambda act: act.seconds)
    for frame in frames:
        bodies = output(frame.bodies, frame.time_ns)
        (pose,) = stage.perform(bodies, frame.time_ns)
        take.shots.append(Shot(frame.time_ns, bodies, pose, stage.cues()[name]))
        second = (frame.time_ns - frames[0].time_ns) * 1e-9
        while waiting and second >= waiting[0].seconds and bodies:
            act = waiting.pop(0)
            stage.possess(name, act.body, act.parts, act.mode)
            take.held_ns.append(frame.time_ns)
    return take
