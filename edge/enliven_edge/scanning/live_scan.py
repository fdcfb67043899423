"""A scan beside the edge's loop: a thread fuses the newest image, and tells viewers how it goes."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from enliven.arrays import Float
from enliven.errors import EnlivenError, InputError, place_of
from enliven.frames import DepthFrame
from enliven.meshes import Mesh
from enliven.scanning import Scanner, ScanSettings, ScanState, ScanStep, VolumeSettings, alone_within
from enliven.scanning.objects import MovedScanner, MovedStep, ObjectState, following
from enliven.wire import Scan, ScanMessage, ScanPieceMessage
from enliven_edge.scanning.checkpoints import Checkpoints
from enliven_edge.scanning.diary import ScanDiary
from enliven_edge.scanning.finish import Keep, finished
from enliven_edge.scanning.growing import GrowingSurface
from enliven_edge.scanning.person import FARTHEST, PersonScanner, ScannedPerson
from enliven_edge.scanning.shown import ThingTold, shown_of
from enliven_edge.scanning.standing import ScanPlace
from enliven_edge.scanning.things import said_of_places

log = logging.getLogger(__name__)

_TOLD_EVERY = 0.1
"""Seconds between two messages of how it goes: lost is seen at once."""
_SHOWN_EVERY = 0.25
"""Seconds between two looks for pieces that changed."""
_BYTES = 400_000
"""Bytes a second of pieces at most: a wireless network carries them beside the poses."""
_WAITS = 0.03
"""Seconds that an image of a recording waits before the edge's loop looks after other things: a frame."""
_TRIANGLES = 50_000
"""Of the mesh that the scan becomes: a chair keeps within a millimetre."""

Phase = Literal["scanning", "paused", "finishing", "done", "failed"]
_PHASE_AFTER: dict[str, Phase] = {"pause": "paused", "go on": "scanning", "done": "finishing"}
"""The phase that begins with an order, as soon as it is heard."""
Cast = Callable[[Mesh, str, ScannedPerson | None], Any]
"""Makes a character's actor of a mesh, its id and the person that it shows."""


@dataclass
class ScanRun:
    """What "undo" takes back: the surface, and what is told of it and of a thing that is moved."""

    scanner: Scanner | MovedScanner
    diary: ScanDiary
    thing: ThingTold = field(default_factory=ThingTold)


def scan_settings(order: Scan) -> ScanSettings:
    """Returns the settings of a scan that a viewer asked for."""
    volume = VolumeSettings(voxel=order.voxel)
    if order.person:
        return alone_within(replace(volume, reach=FARTHEST), FARTHEST)
    return ScanSettings(volume=volume) if order.within is None else alone_within(volume, order.within)


def _scanner_of(order: Scan) -> Scanner | MovedScanner:
    """Returns what fuses the images of a scan."""
    settings = scan_settings(order)
    if order.person:
        return PersonScanner(settings)
    if order.turned:
        return MovedScanner(following(settings))
    return MovedScanner(settings) if order.moved else Scanner(settings)


class LiveScan(threading.Thread):
    """One scan: images are offered from the edge's loop, messages are taken there.

    Args:
        number: of the scan.
        order: how it is begun; with the name of the character that it becomes.
        cast: makes the actor, in this scan's own thread.

    Attributes:
        actor: what was scanned, for the stage, once it is done; the loop takes it.
    """

    def __init__(self, number: int, order: Scan, cast: Cast) -> None:
        super().__init__(name="scan", daemon=True)
        self.number, self.order, self.actor = number, order, None
        self._cast = cast
        self._run = ScanRun(_scanner_of(order), ScanDiary(), ThingTold("person" if order.person else ""))
        self._checkpoints: Checkpoints[ScanRun] = Checkpoints()
        self._growing, self._place = GrowingSurface(number), ScanPlace()
        self._frame: DepthFrame | None = None
        self._orders: deque[Scan] = deque()
        self._messages: deque[ScanMessage | ScanPieceMessage] = deque()
        self._wake, self._ended = threading.Condition(), False
        self.phase: Phase = "scanning"
        self._tracking, self._now_ns, self._note = "", 0, ("", "")
        self._camera: Float | None = None
        self._told = self._shown = 0.0
        self._alone = False
        self._ends, self._joints = list[float](), list[float]()

    def offer(self, frame: DepthFrame, *, waits: bool = False) -> bool:
        """Gives the newest image; one that was not looked at yet is passed over, or waited for a moment.

        Returns:
            False where it is to be given again, since the one before still waits.
        """
        with self._wake:
            waits = waits and self.phase == "scanning"
            if waits and not self._wake.wait_for(lambda: self._frame is None, _WAITS):
                return False
            self._frame = frame
            self._wake.notify_all()
        return True

    def ask(self, order: Scan) -> None:
        """Carries out a viewer's order, soon.

        Raises:
            InputError: where it cannot be done now.
        """
        if self.phase == "finishing":
            raise InputError("the mesh is being made", where="scan", mend="Wait until it stands there.")
        if order.do == "undo" and not self._checkpoints.seconds(self._now_ns):
            raise InputError("there is nothing to take back", where="scan", mend="Cancel it, or scan on.")
        after = _PHASE_AFTER.get(order.do)
        if after is not None and (order.do != "pause" or self.phase == "scanning"):
            # At once, and not when the thread comes to it, which may look at a large surface for seconds.
            self.phase, self._note = after, ("", "")
            self._messages.append(self._message())
        with self._wake:
            if order.do in ("undo", "done"):
                self._orders.append(order)
            self._wake.notify()

    def messages(self) -> list[ScanMessage | ScanPieceMessage]:
        """Returns what is to be told to viewers since the last call."""
        found = []
        while self._messages:
            found.append(self._messages.popleft())
        return found

    def end(self) -> None:
        """Ends it, soon; what was scanned is forgotten."""
        with self._wake:
            self._ended = True
            self._wake.notify()

    def run(self) -> None:
        """Fuses images and carries out orders, until it is ended."""
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._ended or self._orders or self._frame, _TOLD_EVERY)
                if self._ended:
                    return
                frame, self._frame = self._frame, None
                self._wake.notify_all()
                order = self._orders.popleft() if self._orders else None
            try:
                if order is not None:
                    self._obey(order)
                elif frame is not None and self.phase == "scanning":
                    self._fuse(frame)
            except EnlivenError as error:
                self._fail(error)
            except Exception as error:  # the edge's loop goes on, and the scan says why it does not
                log.exception("the scan failed")
                mend = "Cancel it and scan again; the log of the edge says more."
                self._fail(InputError(f"the scan failed{place_of(error)}", where="scan", mend=mend))
            self._tell()

    def _fuse(self, frame: DepthFrame) -> None:
        """Adds an image."""
        run = self._run
        added = run.scanner.add(frame)
        if isinstance(added, MovedStep):
            step = self._moved(added, frame.time_ns)
        else:
            step, self._camera = added, added.world_from_camera
            run.diary.add(step, frame.time_ns)
        self._tracking, self._now_ns = step.state.value, frame.time_ns
        if step.state is ScanState.SCANNING:
            self._checkpoints.offer(run, frame.time_ns, run.scanner.megabytes)

    def _moved(self, added: MovedStep, time_ns: int) -> ScanStep:
        """Notes what became of a thing that is moved; returns what became of the image."""
        thing, places = self._run.thing, self._run.thing.places
        thing.take(added, time_ns)
        if thing.places != places:
            self._shown = 0.0  # The camera is in another room now: where that stands is told with it.
        known = added.state in (ObjectState.RESTING, ObjectState.FOLLOWED)
        self._camera = added.scan.world_from_camera if known else None
        self._run.diary.add(added.told, time_ns)
        return added.told

    def _obey(self, order: Scan) -> None:
        """Does what a viewer asked for."""
        self._note = ("", "")
        if order.do == "undo":
            before = self._checkpoints.back(self._now_ns)
            self._run = before or self._run
            room = shown_of(self._run.scanner).room
            self._camera = room.poses[-1][1] if room is not None and room.poses else None
        elif order.do == "done":
            self._finish(order)

    def _finish(self, order: Scan) -> None:
        """Makes the character."""
        run, name = self._run, self.order.name or "scan"
        run.diary.refuse("scan", run.scanner)
        made = finished(run.scanner, self._meant(order), _TRIANGLES, name)
        self.actor = self._cast(made.mesh, name, made.person)
        if made.person is not None:
            told = self.actor.settings
            self._ends, self._joints = ([x for one in many for x in one] for many in (told.ends, told.joints))
        places = [] if order.whole else said_of_places(run.scanner)
        self._note = _note([*places, *run.diary.advice(run.scanner)], made.said)
        self.phase = "done"

    def _meant(self, order: Scan) -> Keep:
        """Returns what is kept, as a viewer wants it."""
        if order.box:
            low, high = np.array(order.box, float).reshape(2, 3)
            frame = np.vstack([np.array(order.stage_from_scan).reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])
            return Keep("box", low, high, frame)
        return Keep("all" if order.whole else "thing" if self.order.within is None else "alone")

    def _fail(self, error: EnlivenError) -> None:
        """Says what is wrong; the scan goes on where it is asked to."""
        # In a window it is a button, and no option of a command.
        self._note = error.what[:160], error.mend.replace("add --whole to keep", "keep")[:160]
        self.phase = "failed"

    def _tell(self) -> None:
        """Tells how it goes, and the pieces that changed."""
        now, scanner = time.monotonic(), self._run.scanner
        if now - self._shown >= _SHOWN_EVERY and self.phase in ("scanning", "paused", "failed"):
            since, self._shown = min(now - self._shown, 1.0), now
            shown = shown_of(scanner)
            if shown.alone is not self._alone:
                self._alone = shown.alone
                self._growing.anew()
            self._messages.extend(self._growing.changes(shown.volume, round(_BYTES * since)))
            self._place.look(shown)
        if now - self._told >= _TOLD_EVERY or self.phase == "done":
            self._told = now
            self._messages.append(self._message())

    def _message(self) -> ScanMessage:
        diary, place, scanner = self._run.diary, self._place, self._run.scanner
        missing = scanner.missing if isinstance(scanner, PersonScanner) else place.missing
        return ScanMessage(
            number=self.number,
            phase=self.phase,
            tracking=self._tracking,
            time_ns=self._now_ns,
            fused=diary.counts[ScanState.SCANNING],
            way=diary.way,
            full=scanner.full,
            undoable=self._checkpoints.seconds(self._now_ns),
            missing=missing,
            stage_from_scan=place.rows(),
            stage_from_camera=[] if self._camera is None else place.rows(self._camera),
            view=[] if self._camera is None else place.view,
            character=(self.order.name or "") if self.phase == "done" else "",
            note=self._note[0],
            mend=self._note[1],
            thing=self._run.thing.word,
            seconds=self._run.thing.seconds,
            places=self._run.thing.places,
            ends=self._ends if self.phase == "done" else [],
            joints=self._joints if self.phase == "done" else [],
        )


def _note(said: list[str], otherwise: str) -> tuple[str, str]:
    """Returns the first of some things to say as a note and what to do about it."""
    note, _, mend = (said[0] if said else otherwise).partition(". ")
    return note[:160], mend[:160]
