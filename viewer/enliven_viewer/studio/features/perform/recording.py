"""Recordings from an edge's stage onto the project's timeline: count-in, punch-in and punch-out, retakes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from enliven.document import Project
from enliven.errors import InputError
from enliven.modeling.edits import choose_take, find_alternatives
from enliven.overdub.performance import PerformedMotion
from enliven.overdub.performance_takes import add_performance
from enliven_viewer.language import later, tr
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.studio.app.contributions import Phase, TimelineRecording
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.recorder import LiveRecorder
from enliven_viewer.studio.features.perform.secondary_edges import SecondaryEdge

_COUNT_IN_S = 3.0
"""Length of the count-in in seconds: one beat per second."""
_SILENCE_TIMEOUT_S = 4.0
"""Seconds without messages from an edge after which a recording ends. Short network interruptions are
shorter.
"""
_MIN_SPAN_S = 0.05
"""Minimum length of the marked span in seconds. A shorter span is probably unintended."""
_RECORD_PREFIX = "record "
"""Prefix of a recording's name in the undo history."""
_MUTE_PREFIX = "silence "
"""Prefix of the name in the undo history of the edit that mutes takes before recording an alternative."""


class StageRecording(TimelineRecording):
    """Records a stage until the artist stops it, and stores the recording as one edit of the project.

    Args:
        editor: the editor; recordings become edits of its project.
        live: returns the followed stage; None without a connection.
        connected: returns whether messages arrive from an edge.
        may: a function that takes a text about a missing condition, shows it, and returns True if the text is
            empty.
        lacks: returns the reason why the edge cannot be used; empty if it can be used.
        guests: secondary edges that are recorded too, each by its own clock.

    Attributes:
        recorder: receives all messages.
        replaces: True if a recording replaces the existing motion of the moved bones. Otherwise it is added
            (overdub).
        count_in: whether three beats precede a recording.
        hold_still: seconds of stillness of all performers who end a recording; 0 disables this.
        loops: True to record the span repeatedly. Each pass becomes an alternative take.
        phase_when_pressed: the phase at the time when the mouse button went down on the record button.
    """

    def __init__(
        self,
        editor: Editor,
        live: Callable[[], LiveStage | None],
        connected: Callable[[], bool],
        may: Callable[[str], bool],
        lacks: Callable[[], str],
        guests: Sequence[SecondaryEdge] = (),
    ) -> None:
        self.editor = editor
        self.recorder = LiveRecorder()
        self.phase = "idle"
        self.phase_when_pressed: Phase = "idle"
        self.replaces = False
        self.count_in, self.hold_still = True, 0.0
        self.loops = False
        self._alternatives = self._new_take = ""
        self._live, self._connected, self._check_availability, self._find_refusal = (
            live,
            connected,
            may,
            lacks,
        )
        self._secondary_edges = guests
        self._count_in_left_s = self._silent_s = self._start_time = 0.0

    def advance(self, seconds: float) -> None:
        """Advances the count-in or the recording."""
        if self.phase == "counting":
            self._count_in_left_s -= seconds
            if self._count_in_left_s <= 0.0:
                self._begin()
        elif self.phase == "recording":
            # Set the playhead from the sensor's clock, so that it does not depend on the frame rate.
            self.editor.recorded_until_s = self.editor.time = self._start_time + self.seconds
            is_connected = self._connected() or any(guest.connected for guest in self._secondary_edges)
            self._silent_s = 0.0 if is_connected else self._silent_s + seconds
            if self.hold_still and self.recorder.still_s > self.hold_still:
                self.stop(self.recorder.stillness.since_ns)
            elif self.span is not None and self.seconds >= self.span[1] - self._start_time:
                self._end_span(self.span)
            elif (
                self.recorder.is_cut_short and not self._secondary_edges
            ) or self._silent_s > _SILENCE_TIMEOUT_S:
                self.stop()
                self.editor.toasts.show_message(
                    tr("The connection to the stage was lost, so the recording ended"),
                    tr("The recording up to that point is kept."),
                )

    @property
    def seconds(self) -> float:
        """Returns the recorded length in seconds: the maximum over all edges."""
        return max(
            recorder.seconds
            for recorder in (self.recorder, *(guest.recorder for guest in self._secondary_edges))
        )

    @property
    def beat(self) -> int:
        """Returns the current beat of the count-in: 3, 2, 1, or 0 if no count-in is running."""
        return int(self._count_in_left_s) + 1 if self.phase == "counting" else 0

    @property
    def clip(self) -> tuple[float, float] | None:
        """Returns the start and end on the timeline of the running recording, in seconds.

        Returns None if no recording is running.
        """
        return (self._start_time, self.editor.recorded_until_s) if self.phase == "recording" else None

    @property
    def span(self) -> tuple[float, float] | None:
        """Returns the start and end in seconds of the recording span (punch-in and punch-out).

        Returns None to record from the playhead on.
        """
        return self.editor.marked_range

    @span.setter
    def span(self, span: tuple[float, float] | None) -> None:
        self.editor.marked_range = span

    def toggle(self) -> None:
        """Starts a recording with its count-in, or ends it."""
        if self.phase != "idle":
            self.stop()
        elif self._check_availability(self._find_refusal()):
            self.phase, self._count_in_left_s = "counting", _COUNT_IN_S if self.count_in else 0.0

    def record_again(self, *, keeps_last: bool = False) -> None:
        """Starts again where the recording began. Drops a running recording, and undoes a finished recording.

        Args:
            keeps_last: True to keep the finished recording, muted, as an alternative take of the new
                recording.
        """
        if self.phase == "idle":
            if not self.last_recording:
                self.editor.toasts.show_message(tr("Nothing was recorded yet"), tr("Record first."))
                return
            alternatives = find_alternatives(self.editor.project, self.last_recording)
            if keeps_last:
                self._mute_alternatives(alternatives)
            else:
                self._alternatives = alternatives if alternatives != self.last_recording else ""
                self.editor.undo()
        elif self.phase == "recording":
            self._end_recorders()
            self.editor.recorded_until_s = 0.0
        self.phase = "idle"
        self.editor.scrub(self._start_time)
        self.toggle()

    @property
    def last_recording(self) -> str:
        """Returns the name of the recording if it was the last edit, otherwise an empty text."""
        name = self.editor.history.undo_name or ""
        return name.removeprefix(_RECORD_PREFIX) if name.startswith(_RECORD_PREFIX) else ""

    def _mute_alternatives(self, alternatives: str) -> None:
        """Mutes all takes of a group of alternatives, before another take is recorded."""
        self.editor.edit(
            later("silence {0}", alternatives), lambda p: choose_take(p, alternatives, ""), over_locks=True
        )
        self._alternatives = alternatives

    def set_span_end(self, end: int) -> None:
        """Sets the start (0) or the end (1) of the recording span to the playhead.

        An empty span is removed.
        """
        self.editor.set_loop_point(end)

    def stop(self, until_ns: int | None = None) -> None:
        """Ends the count-in, or ends the recording and adds its takes and layers to the project as one edit.

        Args:
            until_ns: time on the sensor's clock at which the recording is cut off; None keeps all of it.
        """
        phase, self.phase = self.phase, "idle"
        alternatives, self._alternatives = self._alternatives, ""
        if phase != "recording":
            if alternatives and (self.editor.history.undo_name or "").startswith(_MUTE_PREFIX):
                self.editor.undo()
            return
        editor = self.editor
        (performed, *others), start, replaces = self._end_recorders(), self._start_time, self.replaces
        if until_ns is not None:
            others = [other.cut_at(other.since_ns + until_ns - performed.since_ns) for other in others]
            performed = performed.cut_at(until_ns)
        editor.recorded_until_s, editor.playing = 0.0, False
        added: list[str] = []

        def change(project: Project) -> Project:
            after, names = _insert_recording(
                project, (performed, *others), start, replaces=replaces, alternatives=alternatives
            )
            added.extend(names)
            return after

        if editor.edit(later("record {0}", performed.name), change, over_locks=True):
            shown_names = [name for name in added if name in editor.project.characters] or added
            editor.toasts.show_message(
                tr("Recorded {0}", ", ".join(shown_names)),
                tr("Ctrl+Z undoes the recording. Record again to add more motion."),
            )
            editor.scrub(start)
            editor.playing, self._new_take = True, shown_names[-1]

    def make_unfinished_edit(self) -> Callable[[Project], Project] | None:
        """Returns the edit that stores the unfinished recording, which continues, or None without a
        recording.

        The edit has its own copy of the recording, so it may run in another thread.
        """
        if self.phase != "recording":
            return None
        recorders = (self.recorder, *(guest.recorder for guest in self._secondary_edges))
        copies = [copy for copy in (recorder.copy_unfinished() for recorder in recorders) if copy is not None]
        start, replaces, alternatives = self._start_time, self.replaces, self._alternatives
        return lambda project: _insert_recording(
            project, copies, start, replaces=replaces, alternatives=alternatives
        )[0]

    def discard(self) -> None:
        """Discards the count-in or the running recording."""
        phase, self.phase = self.phase, "idle"
        alternatives, self._alternatives = self._alternatives, ""
        if phase == "recording":
            self._end_recorders()
            self.editor.recorded_until_s, self.editor.playing = 0.0, False
        if alternatives and (self.editor.history.undo_name or "").startswith(_MUTE_PREFIX):
            self.editor.undo()

    def take_last_character(self) -> str:
        """Returns the character that was recorded last, and forgets it, so that the next call returns an
        empty text.
        """
        fresh, self._new_take = self._new_take, ""
        return fresh

    def _end_recorders(self) -> list[PerformedMotion]:
        """Ends all recorders and returns their recordings. The primary edge's recording comes first."""
        return [
            recorder.end()
            for recorder in (self.recorder, *(g.recorder for g in self._secondary_edges))
            if recorder.recording
        ]

    def _end_span(self, span: tuple[float, float]) -> None:
        """Keeps the recording of the span. In loop mode the next pass starts at once."""
        start_ns = self.recorder.since_ns + round((span[1] - self._start_time) * 1e9)
        self.stop(start_ns)
        if self.loops:
            if alternatives := find_alternatives(self.editor.project, self.last_recording):
                self._mute_alternatives(alternatives)
            self._begin()

    def _begin(self) -> None:
        """Starts recording, and plays the project from the playhead on."""
        editor, live = self.editor, self._live()
        assert live is not None
        self.phase, self._silent_s = "recording", 0.0
        default_start = editor.time if editor.time < editor.length - _MIN_SPAN_S else 0.0
        self._start_time = editor.recorded_until_s = default_start if self.span is None else self.span[0]
        name = self._make_name()
        self.recorder.begin(name, self._measure_delay_ns())
        for guest in self._secondary_edges:
            guest.recorder.begin(name, guest.delay_ns)
        editor.time, editor.playing = self._start_time, True
        live.playhead.go_live()

    def _measure_delay_ns(self) -> int:
        """Returns the measured latency in nanoseconds from a performer's movement to its arrival here.

        Returns 0 if unknown.
        """
        live = self._live()
        edge = None if live is None else live.document.edge
        if edge is None or edge.sensor_to_pose_ms is None:
            return 0
        return round(1e6 * (edge.sensor_to_pose_ms + (edge.pose_to_screen_ms or 0.0)))

    def _make_name(self) -> str:
        takes = self.editor.project.takes
        number = 1
        while any(name == f"take {number}" or name.startswith(f"take {number} ") for name in takes):
            number += 1
        return f"take {number}"


def _insert_recording(
    project: Project, performed: Sequence[PerformedMotion], start: float, *, replaces: bool, alternatives: str
) -> tuple[Project, list[str]]:
    """Returns a project with a recording inserted at a time, and the ids of its new items.

    Raises:
        InputError: if nothing moved.
    """
    after, names = project, list[str]()
    for recording in performed:
        begin = recording.since_ns - round(start * 1e9)
        after, new = add_performance(after, recording, begin, replaces=replaces, beside=alternatives)
        names += new
    if not names:
        problem, remedy = (
            tr("nothing moved during the recording"),
            tr("Step in front of the camera, or possess a character."),
        )
        raise InputError(problem, where="recording", remedy=remedy)
    return after, names
