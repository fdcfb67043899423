"""Performing in the window: an edge's stage beside the project, and what is recorded from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

from enliven.document import Project
from enliven.errors import EnlivenError, InputError
from enliven.takes import with_performed
from enliven_viewer.link import EdgeClient, EdgeFeed, StageLink, TakeFeed
from enliven_viewer.live import LiveStage
from enliven_viewer.playback import Document, Timeline
from enliven_viewer.render import Scene
from enliven_viewer.settings import PlaybackSettings
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.perform.addresses import Addresses
from enliven_viewer.studio.perform.holders import Holder
from enliven_viewer.studio.perform.nearby import NearbyEdge
from enliven_viewer.studio.perform.recorder import LiveRecorder
from enliven_viewer.studio.perform.sender import StageSender

ROOMS = ("Perform", "Animate", "Model", "Play")
"""The workspaces: which panels are in reach; what is loaded never changes with them."""
_COUNT = 3.0
"""Seconds of the count-in: one beat each."""
_GONE = 4.0
"""Seconds for which an edge has been called silent that end a recording: a weak link comes back sooner."""
Phase = Literal["idle", "counting", "recording"]


class PerformSession:
    """The link of a window to one edge, or to a take, and the recording from it.

    Args:
        editor: what is edited; recordings become edits of its project.
        folder: where the last addresses are kept.

    Attributes:
        room: the workspace, of :data:`ROOMS`.
        live: what is followed; None without a link.
        phase: whether a recording is counted in or under way.
        replaces: whether a recording takes the place of what the bones that moved play already.
        count_in: whether three beats come before a recording.
        address: what is typed into the field.
    """

    def __init__(self, editor: Editor, folder: Path | None = None) -> None:
        self.editor = editor
        self.addresses = Addresses(folder)
        self.room = "Animate"
        self.live: LiveStage | None = None
        self.recorder = LiveRecorder()
        self.sender = StageSender(editor.toasts.say)
        self.phase: Phase = "idle"
        self.replaces = False
        self.count_in = True
        self.address = ""
        self._client: EdgeClient | None = None
        self._nearby: NearbyEdge | None = None
        self._left = self._silent = 0.0
        self._start = 0.0
        self._framed: tuple[str, ...] = ()

    # The link ---------------------------------------------------------------------------------------------

    def connect(self, address: str, settings: PlaybackSettings | None = None) -> None:
        """Follow the edge at an address, HOST or HOST:PORT.

        Raises:
            InputError: where that is no address.
        """
        client = EdgeClient([address.strip()], "enliven window")
        self.disconnect()
        self._client, feed = client, EdgeFeed(client)
        feed.heard, feed.restarted = self.recorder.heard, self._began_again
        self.live = LiveStage(feed, Document(Timeline(settings or PlaybackSettings())))
        self.addresses.remember(address.strip())

    def connect_nearby(self, *words: str) -> None:
        """Start an edge on this machine and follow it; ``words`` are of its command line.

        Raises:
            ResourceError: where the edge's program is not installed.
        """
        edge = NearbyEdge(*words)
        self.connect(str(edge.endpoint))
        self._nearby = edge
        self.editor.toasts.say("A stage is made ready on this machine", "This takes some seconds.")

    def follow_take(self, path: Path, settings: PlaybackSettings | None = None) -> None:
        """Play a take as it was recorded: poses, performers, who held what.

        Raises:
            InputError: where the file is no take.
        """
        feed = TakeFeed(path)
        self.disconnect()
        self.live = LiveStage(
            feed, Document(Timeline(settings or PlaybackSettings(), bounded=False)), take=path.name
        )

    def disconnect(self) -> None:
        """Let the edge go; what was recorded until now is kept."""
        self.stop()
        if self.live is not None:
            self.live.close()
        if self._nearby is not None:
            self._nearby.close()
        self.live = self._client = self._nearby = None
        self.editor.beside_box = None
        self.sender.forget()
        self.recorder = LiveRecorder()

    @property
    def known(self) -> tuple[str, ...]:
        """The addresses of before, the newest first."""
        return self.addresses.known

    @property
    def connected(self) -> bool:
        """Whether an edge is heard."""
        return self._client is not None and self.live is not None and self.live.document.edge.connected

    @property
    def stage(self) -> StageLink | None:
        """The stage of the edge; None without one."""
        return None if self._client is None else self._client.stage

    @property
    def holders(self) -> tuple[Holder, ...]:
        """Who holds what now."""
        return self.recorder.holders.now if self.connected else ()

    @property
    def performers(self) -> tuple[int, ...]:
        """The ids of the performers in view."""
        return () if self.live is None else tuple(sorted(body.id for body in self.live.scene.bodies))

    @property
    def present(self) -> tuple[str, ...]:
        """What is on the live stage, a line each: performers, characters, loose things; empty without one."""
        if self.live is None:
            return ()
        people = (f"Performer {body}" for body in self.performers)
        return (*people, *self.standing) or ("No one is there yet",)

    @property
    def standing(self) -> tuple[str, ...]:
        """The ids of the characters on the edge's stage."""
        return () if self._client is None else tuple(self._client.characters)

    @property
    def hidden(self) -> frozenset[str]:
        """Characters of the project that are at rest, and seen as they stand on the edge's stage instead."""
        if self._client is None or self.editor.playing or not (self.connected and self._performing):
            return frozenset()
        return frozenset(self.editor.project.characters.keys() & self._client.characters.keys())

    @property
    def scene(self) -> Scene | None:
        """What is live, without the twins of characters that are edited or play; None without a link."""
        if self.live is None:
            return None
        scene, own = self.live.scene, self.editor.project.characters.keys()
        if self._performing and (self.phase == "recording" or not self.editor.playing):
            return scene
        return replace(scene, actors=tuple(one for one in scene.actors if one.character.id not in own))

    @property
    def _performing(self) -> bool:
        return self.room in ("Perform", "Play")

    # Once a picture ---------------------------------------------------------------------------------------

    def advance(self, seconds: float) -> None:
        """Take in what has arrived, and go on with what is under way."""
        if self.live is None:
            return
        self.live.advance(seconds)
        self.live.report_view(self.editor.lens.view)
        self.editor.beside_box = self.live.scene.box
        self._watch_edge()
        if self._client is not None:
            if self.editor.draft is None:
                self.sender.advance(self._client.stage, self.editor.project)
            self._go_on(seconds)
        if self._performing and self.live.present != self._framed and self.live.scene.box:
            self.editor.frame_all(at_once=not self._framed, reset=not self._framed)
            self._framed = self.live.present

    def _watch_edge(self) -> None:
        """Notice an edge of this machine that could not be started, or has ended."""
        if self._nearby is not None and not self.connected and (why := self._nearby.ended) is not None:
            self.editor.toasts.complain(EnlivenError(why, where="the stage on this machine"))
            self.disconnect()

    def _began_again(self) -> None:
        """Take the edge's new clock, and put on its empty stage what stood there."""
        self.recorder.restarted()
        if self._client is not None:
            self.sender.again(self._client.stage, self.editor.project)

    def _go_on(self, seconds: float) -> None:
        """Go on with the count-in or the recording."""
        if self.phase == "counting":
            self._left -= seconds
            if self._left <= 0.0:
                self._begin()
        elif self.phase == "recording":
            # What plays keeps step with the sensor's clock, however many pictures a second there are.
            self.editor.growing = self.editor.time = self._start + self.recorder.seconds
            self._silent = 0.0 if self.connected else self._silent + seconds
            if self.recorder.cut or self._silent > _GONE:
                self.stop()
                self.editor.toasts.say(
                    "The edge is gone, so the recording ended", "What was done until then is kept."
                )

    # Characters on the stage ------------------------------------------------------------------------------

    def lacks_edge(self) -> str:
        """Why nothing can be asked of an edge, and what to do about it; empty where it can."""
        if self.connected:
            return ""
        return "The stage is silent. Look whether its camera's program runs"

    def lacks_to_put(self) -> str:
        """Why the chosen character cannot be put on the stage, and what to do about it."""
        one = self.editor.chosen()
        if one is None:
            return self.lacks_edge() or "Nothing is chosen. Click the character that is to be performed"
        bare = "It has no surface. Only what has one can be performed" if one.mesh is None else ""
        return self.lacks_edge() or bare

    def lacks_to_take_off(self) -> str:
        """Why the chosen character cannot be taken from the stage, and what to do about it."""
        there = self.editor.selection.character in self.standing
        return self.lacks_edge() or ("" if there else "It does not stand on the stage. Choose one that does")

    def put(self) -> None:
        """Put the chosen character on the stage, where it follows every edit."""
        if self._may(self.lacks_to_put()) and self.stage is not None:
            self.sender.put(self.stage, self.editor.project, self.editor.selection.character or "")

    def take_off(self, name: str = "") -> None:
        """Take a character from the stage: the chosen one where none is named."""
        if self._may("" if name else self.lacks_to_take_off()) and self.stage is not None:
            self.sender.remove(self.stage, name or self.editor.selection.character or "")

    # Recording --------------------------------------------------------------------------------------------

    @property
    def counted(self) -> int:
        """The beat of the count-in: 3, 2, 1; 0 where none is counted."""
        return int(self._left) + 1 if self.phase == "counting" else 0

    @property
    def clip(self) -> tuple[float, float] | None:
        """First and last second, on the timeline, of what is being recorded; None where nothing is."""
        return (self._start, self.editor.growing) if self.phase == "recording" else None

    def record(self) -> None:
        """Count in and record, or end it."""
        if self.phase != "idle":
            self.stop()
        elif self._may(self.lacks_edge()):
            self.phase, self._left = "counting", _COUNT if self.count_in else 0.0

    def stop(self) -> None:
        """End the count-in, or the recording: it becomes takes and layers of the project, as one edit."""
        phase, self.phase = self.phase, "idle"
        if phase != "recording":
            return
        editor = self.editor
        performed, start = self.recorder.end(), self._start
        begin, replaces = performed.since_ns - round(start * 1e9), self.replaces
        editor.growing, editor.playing = 0.0, False
        made: list[str] = []

        def change(project: Project) -> Project:
            after, names = with_performed(project, performed, begin, replaces=replaces)
            if not names:
                what, mend = "nothing moved", "Step in front of the sensor, or take hold of a character."
                raise InputError(what, where="recording", mend=mend)
            made.extend(names)
            return after

        if editor.edit(f"record {performed.name}", change, over_locks=True):
            told = [name for name in made if name in editor.project.characters] or made
            editor.toasts.say(
                f"Recorded {', '.join(told)}", "Ctrl+Z takes it back; record again to add to it."
            )
            editor.scrub(start)
            editor.playing = True

    def _begin(self) -> None:
        """Begin to record, while the project plays from where the playhead is."""
        editor, live = self.editor, self.live
        assert live is not None
        self.phase, self._silent = "recording", 0.0
        self._start = editor.growing = editor.time if editor.time < editor.length - 0.05 else 0.0
        self.recorder.begin(self._name(), self._delay_ns())
        editor.time, editor.playing = self._start, True
        live.playhead.go_live()

    def _delay_ns(self) -> int:
        """Nanoseconds from a performer's movement until it is here, as measured; 0 where it is not known."""
        edge = self.live.document.edge if self.live is not None else None
        if edge is None or edge.sensor_to_pose_ms is None:
            return 0
        return round(1e6 * (edge.sensor_to_pose_ms + (edge.pose_to_screen_ms or 0.0)))

    def _name(self) -> str:
        known = self.editor.project.takes
        number = 1
        while any(one == f"take {number}" or one.startswith(f"take {number} ") for one in known):
            number += 1
        return f"take {number}"

    def _may(self, lacking: str) -> bool:
        """Whether nothing is lacking; says what is."""
        if lacking:
            self.editor.toasts.say(*lacking.split(". "))
        return not lacking
