"""The live outputs of an edge. They get the result of every frame, and are monitored for lost packets."""

from __future__ import annotations

from collections.abc import Sequence

from enliven.arrays import Float
from enliven.frames import DepthFrame
from enliven.health import HealthKind, HealthState
from enliven.outputs.live_frame import CharacterInfo, CharacterInfos, LiveEvent, LiveFrame, PerformerSlots
from enliven.outputs.opening import OutputSet
from enliven.supervision.closeable import Closeable
from enliven_edge.stage.stage import Stage
from enliven_edge.stage.tick import Tick
from enliven_edge.tracking.health.alarm import HEALTH_MESSAGES


class LiveOutputs(Closeable):
    """Passes every frame of the edge to its outputs. Never blocks.

    Args:
        outputs: the open outputs, which this object closes; None if there are none.
    """

    def __init__(self, outputs: OutputSet | None = None) -> None:
        self.outputs = outputs or OutputSet()
        self._numbers = PerformerSlots()
        self._characters = CharacterInfos()
        self._since_ns: dict[str, int] = {}
        self._time_ns = 0

    def check(self, stage: Stage) -> None:
        """Checks that the outputs can send the characters that their addresses name.

        Raises:
            InputError: if an output cannot send its character.
        """
        if self.outputs.statuses:
            self.outputs.check(self._collect_character_infos(stage))

    def publish(
        self, tick: Tick, stage: Stage, world_from_camera: Float | None = None, *, mirrored: bool = False
    ) -> None:
        """Passes the result of a frame to every output. Does not block.

        Args:
            world_from_camera: (4, 4) pose of the sensor, or None if it is not known.
            mirrored: True if performers are mirrored.
        """
        if not self.outputs.statuses:
            return
        self._time_ns = tick.time_ns
        numbered, events = self._numbers.number(tick.bodies, tick.time_ns)
        events += self._hold_events(tick)
        held = frozenset(name for name, actor in stage.actors.items() if actor.holds)
        characters = self._collect_character_infos(stage)
        frame = LiveFrame(
            *(tick.time_ns, numbered, tick.poses, characters, held, tick.props, events),
            depth=tick.frame if isinstance(tick.frame, DepthFrame) else None,
            world_from_camera=world_from_camera,
            mirrored=mirrored,
        )
        self.outputs.put(frame)

    def report_health(self, states: Sequence[HealthState]) -> None:
        """Passes the edge's health states to every output. Does not block."""
        self.outputs.put_health(states)

    @property
    def health_states(self) -> list[HealthState]:
        """Returns the health states of the outputs that are losing packets."""
        troubles = self.outputs.troubles
        self._since_ns = {name: self._since_ns.get(name, self._time_ns) for name in troubles}
        message = HEALTH_MESSAGES[HealthKind.OUTPUT_FAILS]
        return [
            HealthState(
                *(HealthKind.OUTPUT_FAILS, message.severity, self._since_ns[name]),
                *(message.what.format(output=name, why=reason), message.remedy),
            )
            for name, reason in troubles.items()
        ]

    def close(self) -> None:
        """Sends the last frame, and ends the sending process."""
        self.outputs.close()

    def _collect_character_infos(self, stage: Stage) -> dict[str, CharacterInfo]:
        """Returns the constant parts of the characters on the stage."""
        actors = dict(stage.actors)
        shapes = {name: actor.character for name, actor in actors.items()}
        return self._characters.update(shapes, lambda name: actors[name].skeleton)

    def _hold_events(self, tick: Tick) -> list[LiveEvent]:
        """Returns the possessions and releases since the previous frame."""
        events = []
        for hold in tick.holds:
            kind = "release" if hold.mode in ("release", "remove") else "possess"
            performer = self._numbers.find_number(hold.body) if hold.body >= 0 else 0
            events.append(LiveEvent(kind, performer, hold.character))
        return events
