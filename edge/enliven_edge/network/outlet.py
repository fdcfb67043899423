"""The edge's output: sends characters, poses, bodies, cues and heartbeats to viewers and to a take."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec

from enliven.document import Character
from enliven.health import HealthState, sort_by_severity
from enliven.peers.announcer import Announcer
from enliven.supervision.closeable import Closeable
from enliven.wire import (
    BY_TYPE,
    Revision,
    StageMessage,
    board_to_message,
    bodies_to_message,
    character_to_message,
    cues_to_message,
    health_to_messages,
    props_to_message,
)
from enliven_edge.network.access import Access
from enliven_edge.network.command_queue import CommandQueue
from enliven_edge.network.frame_rate import FrameRate
from enliven_edge.network.handlers import Handlers, execute, find_subject
from enliven_edge.network.publisher import Publisher
from enliven_edge.recording.settings import RecordingSettings
from enliven_edge.recording.take import Take
from enliven_edge.settings import WireSettings
from enliven_edge.stage.tick import Tick

_FINAL_HEARTBEATS = 5
"""Number of heartbeats that report the end of the stream. There are several, because one may be lost in
transit."""


def check_free(wire: WireSettings, access: Access | None = None) -> None:
    """Checks that the name and the ports are free, before any slow step.

    Raises:
        ResourceError: for a port in use, or a name in use on this machine.
        InputError: for an address that other machines reach, without keys and ``insecure``.
    """
    with _publisher(wire, access):
        pass


class Outlet(Closeable):
    """Publishes characters, poses and bodies, answers viewers, and writes the take if requested.

    Args:
        wire: name, host and ports.
        sensor: the sensor's identity, for the heartbeat.
        record: the file of the take, or None.
        overwrite: True allows replacing an existing take.
        access: the keys and the paired viewers. If None, everyone who reaches the ports may do everything.
        recording: duration and size of the take's parts, and the space to keep free.
        waits_for_space: True starts the take later if the disk is full now.

    Attributes:
        tells_picture: whether viewers get the camera's pose and preview image.
        announcer: announces the edge on the network; None if it is not announced.

    Raises:
        ResourceError: for a port in use, or a name in use on this machine.
        InputError: for a take that already exists, or an address that other machines reach, without keys and
            ``insecure``.
    """

    def __init__(
        self,
        wire: WireSettings,
        sensor: str,
        *,
        record: Path | None = None,
        overwrite: bool = False,
        access: Access | None = None,
        recording: RecordingSettings | None = None,
        waits_for_space: bool = False,
    ) -> None:
        self._publisher = _publisher(wire, access)
        self._commands = CommandQueue(0.5e-3 * wire.budget)
        try:
            self._handle_report = None
            if record:
                self._handle_report = Take(
                    record, overwrite=overwrite, settings=recording, waits_for_space=waits_for_space
                )
        except BaseException:
            self._publisher.close()
            raise
        self._publisher.set_status(sensor=sensor)
        self._told = 0.0
        self.tells_picture = wire.picture
        self._shown: dict[str, Character] = {}
        self._stage_told = False
        self.announcer: Announcer | None = None

    @property
    def publisher(self) -> Publisher:
        """Returns the sockets."""
        return self._publisher

    @property
    def viewers(self) -> int:
        """Returns the number of viewers."""
        return self._publisher.viewers

    def show(self, characters: Mapping[str, Character], revisions: Mapping[str, int] | None = None) -> None:
        """Announces new and changed characters (compared by object identity), and removes missing ones.

        Args:
            revisions: the minimum revision of each character by id, if known.
        """
        for name, character in characters.items():
            if self._shown.get(name) is not character:
                self.introduce(character, (revisions or {}).get(name, 1))
        for name in self._shown.keys() - characters.keys():
            del self._shown[name]
            self._stage_told = False
            self._publisher.remove_character(name)
            if self._handle_report is not None:
                self._handle_report.remove(name)

    def introduce(self, character: Character, min_revision: int = 1) -> None:
        """Announces a new character, or a new revision of one. Viewers then fetch it."""
        revision = self._publisher.set_character(character, min_revision)
        self._stage_told = False
        self._shown[character.id] = character
        if self._handle_report is not None:
            self._handle_report.introduce(character.id, character_to_message(character, revision))

    def publish(self, tick: Tick) -> None:
        """Sends the result of one frame, poses first.

        If the set of characters changed, the new set is sent first.
        """
        if not self._stage_told:
            self._stage_told = True
            if self.announcer is not None:
                self.announcer.set_characters(len(self._shown))
            standing = [Revision(name, self._publisher.revision(name)) for name in self._shown]
            self.send(StageMessage(tick.time_ns, standing), tick.time_ns)
        captured_ns = _convert_to_wall_clock(tick.read_ns)
        for pose in tick.poses:
            self._write(self._publisher.publish_pose(pose, captured_ns), tick.time_ns)
        for message in _messages(tick, captured_ns, self._publisher.revision):
            self.send(message, tick.time_ns)

    def send(self, message: Any, time_ns: int) -> None:
        """Sends a message of any topic to the viewers and to the take. Poses are sent by :meth:`publish`."""
        if self._publisher.publish(message):
            self._write(message, time_ns)

    def forget(self, topic: str) -> None:
        """Drops the newest messages of a latched topic. Viewers that connect later do not get them."""
        self._publisher.forget(topic)

    def report(self, pace: FrameRate, phase: str, performers: int, sensor: str = "") -> None:
        """Sets the state of the edge for the heartbeat. A new phase is sent immediately.

        Args:
            sensor: the sensor's identity, if it was not known from the start; empty if unchanged.
        """
        is_changed = phase != self._publisher.status.phase
        if is_changed or time.monotonic() - self._told > 0.25:
            self._told = time.monotonic()
            self._publisher.set_status(
                phase=phase,
                sensor=sensor or self._publisher.status.sensor,
                performers=performers,
                fps=pace.fps,
                latency_p50_ms=pace.latency_ms(50),
                latency_p99_ms=pace.latency_ms(99),
            )

    def set_health(self, states: list[HealthState]) -> None:
        """Sets the health states: those of the edge and those of the take. A change is sent immediately."""
        take = self._handle_report.health_states if self._handle_report is not None else []
        health = health_to_messages(sort_by_severity([*states, *take]))
        published = self._publisher.status.health
        if health == published:
            return
        self._publisher.set_status(health=health)
        if [(h.kind, h.performer) for h in health] != [(h.kind, h.performer) for h in published]:
            self._publisher.send_heartbeat()

    def poll_requests(self, handlers: Handlers) -> None:
        """Answers viewers' requests as far as time allows, and sends heartbeats that are due.

        Args:
            handlers: the handlers by the class of the order. An order without a handler is refused.
        """
        for command in self._publisher.poll():
            command.subject = find_subject(handlers, command.request)
            self._commands.add(command)
        self._commands.execute_commands(
            lambda command: command.reply(execute(handlers, command.request, command.peer))
        )

    def end(self, pace: FrameRate) -> None:
        """Reports the end of the stream several times, because a heartbeat may be lost in transit."""
        self.report(pace, "ended", 0)
        for _ in range(_FINAL_HEARTBEATS):
            self._publisher.send_heartbeat()
            self.poll_requests({})
            time.sleep(0.05)

    def close(self) -> None:
        """Completes the take and releases the ports and the name."""
        if self._handle_report is not None:
            self._handle_report.close()
        if self.announcer is not None:
            self.announcer.close()
        self._publisher.close()

    def _write(self, message: Any, time_ns: int) -> None:
        """Writes a message to the take if its topic is recorded."""
        if self._handle_report is not None and BY_TYPE[type(message)].recorded:
            self._handle_report.write(message, time_ns)


def _convert_to_wall_clock(monotonic_ns: int) -> int:
    """Converts a recent monotonic time to wall-clock time in nanoseconds.

    It uses the current setting of the clock. The result is 0 if the time is unknown.

    The wall clock may be set at any time, so durations are measured with the monotonic clock only.
    """
    return time.time_ns() - (time.monotonic_ns() - monotonic_ns) if monotonic_ns else 0


def _messages(tick: Tick, captured_ns: int, revision_of: Callable[[str], int]) -> Iterator[Any]:
    """Yields the messages of a frame's result, except poses.

    The publisher encodes and numbers the poses.
    """
    tick_ns = tick.time_ns
    yield bodies_to_message(tick.bodies, tick_ns, captured_ns)
    for name, cue in tick.cues.items():
        cue_values = (cue.nodes, cue.strengths, cue.body, tick_ns, cue.owners, cue.held)
        yield cues_to_message(name, cue.state, *cue_values)
    if tick.props is not None:
        yield props_to_message(tick.props)
    for board in tick.boards:
        yield board_to_message(board)
    for change in tick.holds:
        yield msgspec.structs.replace(change, revision=revision_of(change.character))


def _publisher(wire: WireSettings, access: Access | None = None) -> Publisher:
    return Publisher(
        name=wire.name,
        host=wire.host,
        pose_port=wire.port,
        control_port=wire.control_port,
        access=access,
        open_to_all=wire.insecure,
        rate=wire.rate,
        budget_ms=0.5 * wire.budget,
    )
