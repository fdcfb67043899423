"""The recording from an edge's stage onto the project's timeline: counted in, ended, taken again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

from enliven.document import Project
from enliven.errors import InputError
from enliven.modeling.edits import alternatives_of, choose_take
from enliven.takes import Performed, with_performed
from enliven_viewer.language import later, tr
from enliven_viewer.live import LiveStage
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.perform.guests import Guest
from enliven_viewer.studio.perform.recorder import LiveRecorder

_COUNT = 3.0
"""Seconds of the count-in: one beat each."""
_GONE = 4.0
"""Seconds for which an edge has been called silent that end a recording: a weak link comes back sooner."""
_SHORTEST = 0.05
"""Seconds of the shortest span: less is a slip of the hand."""
_RECORD = "record "
"""What the name of an edit begins with that is a recording."""
_SILENCE = "silence "
"""What the name of an edit begins with that silences takes, for one that is recorded beside them."""
Phase = Literal["idle", "counting", "recording"]


class StageRecording:
    """Records what happens on a stage, for as long as an artist wants, as one edit of the project.

    Args:
        editor: recordings become edits of its project.
        live: what is followed; None without a link.
        connected: whether an edge is heard.
        may: says what is lacking, as a text that is not empty, and returns whether nothing is.
        lacks: why nothing can be asked of the edge; empty if it can.
        guests: other edges that are recorded as well, each by its own clock.

    Attributes:
        recorder: hears everything that arrives.
        phase: whether a recording is counted in or under way.
        replaces: whether a recording takes the place of what the bones that moved play already.
        count_in: whether three beats come before a recording.
        hold_still: seconds for which all performers hold still that end a recording; 0: that ends none.
        loops: whether the span is recorded again and again, each time as one more alternative.
        pressed: the phase in which the button of the recording went down.
    """

    def __init__(
        self,
        editor: Editor,
        live: Callable[[], LiveStage | None],
        connected: Callable[[], bool],
        may: Callable[[str], bool],
        lacks: Callable[[], str],
        guests: Sequence[Guest] = (),
    ) -> None:
        self.editor = editor
        self.recorder = LiveRecorder()
        self.phase: Phase = "idle"
        self.pressed: Phase = "idle"
        self.replaces = False
        self.count_in, self.hold_still = True, 0.0
        self.loops = False
        self._beside = self._fresh = ""
        self._live, self._connected, self._may, self._lacks = live, connected, may, lacks
        self._guests = guests
        self._left = self._silent = self._start = 0.0

    def advance(self, seconds: float) -> None:
        """Goes on with the count-in or the recording."""
        if self.phase == "counting":
            self._left -= seconds
            if self._left <= 0.0:
                self._begin()
        elif self.phase == "recording":
            # What plays keeps step with the sensor's clock, however many frames per second there are.
            self.editor.growing = self.editor.time = self._start + self.seconds
            heard = self._connected() or any(guest.connected for guest in self._guests)
            self._silent = 0.0 if heard else self._silent + seconds
            if self.hold_still and self.recorder.still > self.hold_still:
                self.stop(self.recorder.stillness.since_ns)
            elif self.span is not None and self.seconds >= self.span[1] - self._start:
                self._span_ended(self.span)
            elif (self.recorder.cut and not self._guests) or self._silent > _GONE:
                self.stop()
                self.editor.toasts.say(
                    tr("The edge is gone, so the recording ended"), tr("What was done until then is kept.")
                )

    @property
    def seconds(self) -> float:
        """Returns seconds that are recorded so far, by the clock of the edge that goes on longest."""
        return max(one.seconds for one in (self.recorder, *(guest.recorder for guest in self._guests)))

    @property
    def counted(self) -> int:
        """Returns the beat of the count-in: 3, 2, 1; 0 if none is counted."""
        return int(self._left) + 1 if self.phase == "counting" else 0

    @property
    def clip(self) -> tuple[float, float] | None:
        """First and last second, on the timeline, of what is being recorded; None if nothing is."""
        return (self._start, self.editor.growing) if self.phase == "recording" else None

    @property
    def span(self) -> tuple[float, float] | None:
        """Returns the first and the last second of the project that are recorded; None: from the playhead
        on.
        """
        return self.editor.marked

    @span.setter
    def span(self, span: tuple[float, float] | None) -> None:
        self.editor.marked = span

    def record(self) -> None:
        """Counts in and record, or ends it."""
        if self.phase != "idle":
            self.stop()
        elif self._may(self._lacks()):
            self.phase, self._left = "counting", _COUNT if self.count_in else 0.0

    def again(self, *, beside: bool = False) -> None:
        """Begins again where the recording began: what is being recorded is dropped, the last one undone.

        Args:
            beside: whether the last one is kept, silent, as an alternative of what is recorded now.
        """
        if self.phase == "idle":
            if not self.recorded:
                self.editor.toasts.say(tr("There is no recording to take again"), tr("Record first."))
                return
            alternatives = alternatives_of(self.editor.project, self.recorded)
            if beside:
                self._silence(alternatives)
            else:
                self._beside = alternatives if alternatives != self.recorded else ""
                self.editor.undo()
        elif self.phase == "recording":
            self._ended()
            self.editor.growing = 0.0
        self.phase = "idle"
        self.editor.scrub(self._start)
        self.record()

    @property
    def recorded(self) -> str:
        """Returns the name of the recording that the last edit was; empty if that was another."""
        name = self.editor.history.undo_name or ""
        return name.removeprefix(_RECORD) if name.startswith(_RECORD) else ""

    def _silence(self, alternatives: str) -> None:
        """Lets none of some takes be heard, for one more that is recorded."""
        self.editor.edit(
            later("silence {0}", alternatives), lambda p: choose_take(p, alternatives, ""), over_locks=True
        )
        self._beside = alternatives

    def mark(self, end: int) -> None:
        """Makes the playhead the begin (0) or the end (1) of what is recorded; no span where none is left."""
        self.editor.mark(end)

    def stop(self, until_ns: int | None = None) -> None:
        """Ends the count-in, or the recording: it becomes takes and layers of the project, as one edit.

        Args:
            until_ns: the sensor's clock up to which it is kept; None: all of it.
        """
        phase, self.phase = self.phase, "idle"
        beside, self._beside = self._beside, ""
        if phase != "recording":
            if beside and (self.editor.history.undo_name or "").startswith(_SILENCE):
                self.editor.undo()
            return
        editor = self.editor
        (performed, *others), start, replaces = self._ended(), self._start, self.replaces
        if until_ns is not None:
            others = [one.until(one.since_ns + until_ns - performed.since_ns) for one in others]
            performed = performed.until(until_ns)
        editor.growing, editor.playing = 0.0, False
        made: list[str] = []

        def change(project: Project) -> Project:
            after, names = _recorded(project, (performed, *others), start, replaces=replaces, beside=beside)
            made.extend(names)
            return after

        if editor.edit(later("record {0}", performed.name), change, over_locks=True):
            told = [name for name in made if name in editor.project.characters] or made
            editor.toasts.say(
                tr("Recorded {0}", ", ".join(told)), tr("Ctrl+Z takes it back; record again to add to it.")
            )
            editor.scrub(start)
            editor.playing, self._fresh = True, told[-1]

    def so_far(self) -> Callable[[Project], Project] | None:
        """Returns the edit that stores the recording so far, while it goes on; None without a recording.

        The edit has its own copy of the recording, so it can be done in another thread.
        """
        if self.phase != "recording":
            return None
        recorders = (self.recorder, *(guest.recorder for guest in self._guests))
        copies = [copy for copy in (one.so_far() for one in recorders) if copy is not None]
        start, replaces, beside = self._start, self.replaces, self._beside
        return lambda project: _recorded(project, copies, start, replaces=replaces, beside=beside)[0]

    def drop(self) -> None:
        """Discards the count-in or the running recording."""
        phase, self.phase = self.phase, "idle"
        beside, self._beside = self._beside, ""
        if phase == "recording":
            self._ended()
            self.editor.growing, self.editor.playing = 0.0, False
        if beside and (self.editor.history.undo_name or "").startswith(_SILENCE):
            self.editor.undo()

    def seen(self) -> str:
        """Returns the character that was recorded last, once; empty if it was asked for already."""
        fresh, self._fresh = self._fresh, ""
        return fresh

    def _ended(self) -> list[Performed]:
        """What the recorders have, the led edge's first; nothing more is recorded."""
        return [one.end() for one in (self.recorder, *(g.recorder for g in self._guests)) if one.recording]

    def _span_ended(self, span: tuple[float, float]) -> None:
        """Keeps what was recorded of the span; where it loops, the next one begins at once."""
        begun = self.recorder.since_ns + round((span[1] - self._start) * 1e9)
        self.stop(begun)
        if self.loops:
            if alternatives := alternatives_of(self.editor.project, self.recorded):
                self._silence(alternatives)
            self._begin()

    def _begin(self) -> None:
        """Begins to record, while the project plays from where the playhead is."""
        editor, live = self.editor, self._live()
        assert live is not None
        self.phase, self._silent = "recording", 0.0
        usual = editor.time if editor.time < editor.length - _SHORTEST else 0.0
        self._start = editor.growing = usual if self.span is None else self.span[0]
        name = self._name()
        self.recorder.begin(name, self._delay_ns())
        for guest in self._guests:
            guest.recorder.begin(name, guest.delay_ns)
        editor.time, editor.playing = self._start, True
        live.playhead.go_live()

    def _delay_ns(self) -> int:
        """Returns nanoseconds from a performer's movement until it is here, as measured; 0 if it is not
        known.
        """
        live = self._live()
        edge = None if live is None else live.document.edge
        if edge is None or edge.sensor_to_pose_ms is None:
            return 0
        return round(1e6 * (edge.sensor_to_pose_ms + (edge.pose_to_screen_ms or 0.0)))

    def _name(self) -> str:
        known = self.editor.project.takes
        number = 1
        while any(one == f"take {number}" or one.startswith(f"take {number} ") for one in known):
            number += 1
        return f"take {number}"


def _recorded(
    project: Project, performed: Sequence[Performed], start: float, *, replaces: bool, beside: str
) -> tuple[Project, list[str]]:
    """Returns a project with a recording inserted at a second, and the ids of its new items.

    Raises:
        InputError: if nothing moved.
    """
    after, names = project, list[str]()
    for one in performed:
        begin = one.since_ns - round(start * 1e9)
        after, new = with_performed(after, one, begin, replaces=replaces, beside=beside)
        names += new
    if not names:
        what, mend = tr("nothing moved"), tr("Step in front of the sensor, or take hold of a character.")
        raise InputError(what, where="recording", mend=mend)
    return after, names
