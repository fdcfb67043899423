"""A scan in the background of the edge's loop: a thread fuses the newest image and reports progress to
viewers."""

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
from enliven.errors import EnlivenError, InputError, error_location
from enliven.frames import DepthFrame
from enliven.meshes import Mesh
from enliven.scanning import Scanner, ScanSettings, ScanState, ScanStep, VolumeSettings, settings_within
from enliven.scanning.objects import MovedScanner, MovedStep, ObjectState, object_tracking_settings
from enliven.wire import Scan, ScanMessage, ScanPieceMessage
from enliven_edge.scanning.checkpoints import Checkpoints
from enliven_edge.scanning.object_messages import said_of_places
from enliven_edge.scanning.person import FARTHEST, PersonScanner, ScannedPerson
from enliven_edge.scanning.scan_log import ScanLog
from enliven_edge.scanning.scan_mesh import Keep, finished
from enliven_edge.scanning.scan_placement import ScanPlacement
from enliven_edge.scanning.scan_view import MovedObjectState, shown_of
from enliven_edge.scanning.surface_preview import SurfacePreview

log = logging.getLogger(__name__)

_PROGRESS_INTERVAL_S = 0.1
"""Interval between two progress messages, in seconds. It is short, so that lost tracking is shown at once."""
_PREVIEW_INTERVAL_S = 0.25
"""Interval between two searches for changed pieces of the surface, in seconds."""
_MAX_BYTES_PER_SECOND = 400_000
"""Maximum bytes per second of preview pieces: a wireless network carries them in addition to the poses."""
_MAX_WAIT_S = 0.03
"""Longest time that an image of a recording waits before the edge's loop continues, in seconds: one frame."""
_MAX_TRIANGLES = 50_000
"""Maximum number of triangles of the resulting mesh: a chair stays accurate to a millimetre."""

Phase = Literal["scanning", "paused", "finishing", "done", "failed"]
_PHASE_AFTER: dict[str, Phase] = {"pause": "paused", "go on": "scanning", "done": "finishing"}
"""The phase that starts as soon as an order arrives."""
Cast = Callable[[Mesh, str, ScannedPerson | None], Any]
"""Makes a character's actor from a mesh, its id and the person that it shows."""


@dataclass
class ScanRun:
    """The state that "undo" restores: the surface, the scan log, and the state of a moved object."""

    scanner: Scanner | MovedScanner
    scan_log: ScanLog
    thing: MovedObjectState = field(default_factory=MovedObjectState)


def scan_settings(order: Scan) -> ScanSettings:
    """Returns the settings of a scan that a viewer requested."""
    volume = VolumeSettings(voxel=order.voxel)
    if order.person:
        return settings_within(replace(volume, reach=FARTHEST), FARTHEST)
    return ScanSettings(volume=volume) if order.within is None else settings_within(volume, order.within)


def _scanner_of(order: Scan) -> Scanner | MovedScanner:
    """Returns the scanner that fuses the images of a scan."""
    settings = scan_settings(order)
    if order.person:
        return PersonScanner(settings)
    if order.turned:
        return MovedScanner(object_tracking_settings(settings))
    return MovedScanner(settings) if order.moved else Scanner(settings)


class LiveScan(threading.Thread):
    """One scan. The edge's loop offers images and takes messages.

    Args:
        number: the scan's number.
        order: the viewer's request, with the name of the resulting character.
        cast: makes the actor, on this scan's own thread.

    Attributes:
        actor: the scanned character for the stage, once it is done. The loop takes it.
    """

    def __init__(self, number: int, order: Scan, cast: Cast) -> None:
        super().__init__(name="scan", daemon=True)
        self.number, self.order, self.actor = number, order, None
        self._cast = cast
        self._run = ScanRun(_scanner_of(order), ScanLog(), MovedObjectState("person" if order.person else ""))
        self._checkpoints: Checkpoints[ScanRun] = Checkpoints()
        self._growing, self._place = SurfacePreview(number), ScanPlacement()
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
        """Offers the newest image. It replaces an image that was not used yet, or waits for a moment.

        Returns:
            False if the caller must offer it again, because the previous image still waits.
        """
        with self._wake:
            waits = waits and self.phase == "scanning"
            if waits and not self._wake.wait_for(lambda: self._frame is None, _MAX_WAIT_S):
                return False
            self._frame = frame
            self._wake.notify_all()
        return True

    def ask(self, order: Scan) -> None:
        """Queues a viewer's order.

        Raises:
            InputError: if it cannot be done now.
        """
        if self.phase == "finishing":
            raise InputError("the mesh is being made", where="scan", mend="Wait until it is on the stage.")
        if order.do == "undo" and not self._checkpoints.seconds(self._now_ns):
            raise InputError("nothing can be undone", where="scan", mend="Cancel it, or scan on.")
        after = _PHASE_AFTER.get(order.do)
        if after is not None and (order.do != "pause" or self.phase == "scanning"):
            # Change the phase immediately, because the thread may be busy with a large surface for seconds.
            self.phase, self._note = after, ("", "")
            self._messages.append(self._message())
        with self._wake:
            if order.do in ("undo", "done"):
                self._orders.append(order)
            self._wake.notify()

    def messages(self) -> list[ScanMessage | ScanPieceMessage]:
        """Returns the messages for viewers since the last call."""
        messages = []
        while self._messages:
            messages.append(self._messages.popleft())
        return messages

    def end(self) -> None:
        """Ends the thread soon and discards the scan."""
        with self._wake:
            self._ended = True
            self._wake.notify()

    def run(self) -> None:
        """Fuses images and carries out orders, until the scan is ended."""
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._ended or self._orders or self._frame, _PROGRESS_INTERVAL_S)
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
            except Exception as error:  # The edge must go on running, and the scan reports the error.
                log.exception("the scan failed")
                mend = "Cancel it and scan again; the log of the edge says more."
                self._fail(InputError(f"the scan failed{error_location(error)}", where="scan", mend=mend))
            self._tell()

    def _fuse(self, frame: DepthFrame) -> None:
        """Adds an image."""
        run = self._run
        added = run.scanner.add(frame)
        if isinstance(added, MovedStep):
            step = self._moved(added, frame.time_ns)
        else:
            step, self._camera = added, added.world_from_camera
            run.scan_log.add(step, frame.time_ns)
        self._tracking, self._now_ns = step.state.value, frame.time_ns
        if step.state is ScanState.SCANNING:
            self._checkpoints.offer(run, frame.time_ns, run.scanner.megabytes)

    def _moved(self, added: MovedStep, time_ns: int) -> ScanStep:
        """Updates the state of a moved object. Returns the result of the image."""
        thing, places = self._run.thing, self._run.thing.places
        thing.take(added, time_ns)
        if thing.places != places:
            # The camera is now in another room frame, so its placement must be sent at once.
            self._shown = 0.0
        is_placed = added.state in (ObjectState.RESTING, ObjectState.FOLLOWED)
        self._camera = added.scan.world_from_camera if is_placed else None
        self._run.scan_log.add(added.scan_step, time_ns)
        return added.scan_step

    def _obey(self, order: Scan) -> None:
        """Carries out a viewer's order."""
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
        run.scan_log.refuse("scan", run.scanner)
        scan_result = finished(run.scanner, self._meant(order), _MAX_TRIANGLES, name)
        self.actor = self._cast(scan_result.mesh, name, scan_result.person)
        if scan_result.person is not None:
            settings = self.actor.settings
            self._ends, self._joints = (
                [x for group in groups for x in group] for groups in (settings.ends, settings.joints)
            )
        places = [] if order.whole else said_of_places(run.scanner)
        self._note = _note([*places, *run.scan_log.advice(run.scanner)], scan_result.said)
        self.phase = "done"

    def _meant(self, order: Scan) -> Keep:
        """Returns the part that is kept, as the viewer requested."""
        if order.box:
            low, high = np.array(order.box, float).reshape(2, 3)
            frame = np.vstack([np.array(order.stage_from_scan).reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])
            return Keep("box", low, high, frame)
        return Keep("all" if order.whole else "thing" if self.order.within is None else "alone")

    def _fail(self, error: EnlivenError) -> None:
        """Reports an error. The scan goes on if the viewer asks for it."""
        # In a window the user presses a button instead of giving an option of a command.
        self._note = error.what[:160], error.mend.replace("add --whole to keep", "keep")[:160]
        self.phase = "failed"

    def _tell(self) -> None:
        """Sends progress and the pieces that changed."""
        now, scanner = time.monotonic(), self._run.scanner
        if now - self._shown >= _PREVIEW_INTERVAL_S and self.phase in ("scanning", "paused", "failed"):
            since, self._shown = min(now - self._shown, 1.0), now
            shown = shown_of(scanner)
            if shown.alone is not self._alone:
                self._alone = shown.alone
                self._growing.anew()
            self._messages.extend(self._growing.changes(shown.volume, round(_MAX_BYTES_PER_SECOND * since)))
            self._place.look(shown)
        if now - self._told >= _PROGRESS_INTERVAL_S or self.phase == "done":
            self._told = now
            self._messages.append(self._message())

    def _message(self) -> ScanMessage:
        scan_log, place, scanner = self._run.scan_log, self._place, self._run.scanner
        missing = scanner.missing if isinstance(scanner, PersonScanner) else place.missing
        return ScanMessage(
            number=self.number,
            phase=self.phase,
            tracking=self._tracking,
            time_ns=self._now_ns,
            fused=scan_log.counts[ScanState.SCANNING],
            way=scan_log.way,
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
    """Returns the first of several sentences, split into a note and its remedy."""
    note, _, mend = (said[0] if said else otherwise).partition(". ")
    return note[:160], mend[:160]
