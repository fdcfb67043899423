"""A scan in the background of the edge's loop.

A thread fuses the newest image and reports progress to viewers.
"""

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
from enliven.scanning.objects.moved_scanner import MovedScanner, object_tracking_settings
from enliven.scanning.objects.moved_step import MovedStep, ObjectState
from enliven.wire import Scan, ScanMessage, ScanMode, ScanPieceMessage
from enliven_edge.scanning.checkpoints import Checkpoints
from enliven_edge.scanning.object_messages import describe_places
from enliven_edge.scanning.person import MAX_PERSON_DISTANCE_M, PersonScanner, ScannedPerson
from enliven_edge.scanning.scan_log import ScanLog
from enliven_edge.scanning.scan_mesh import KeptPart, finish_scan
from enliven_edge.scanning.scan_placement import ScanPlacement
from enliven_edge.scanning.scan_view import MovedObjectState, create_scan_view
from enliven_edge.scanning.surface_preview import SurfacePreview

log = logging.getLogger(__name__)

_PROGRESS_INTERVAL_S = 0.1
"""Seconds between two progress messages. The interval is short, so that lost tracking is shown
immediately."""
_PREVIEW_INTERVAL_S = 0.25
"""Seconds between two searches for changed chunks of the surface."""
_MAX_BYTES_PER_SECOND = 400_000
"""Maximum bytes of preview chunks per second. A wireless network can transfer them in addition to the
poses."""
_MAX_WAIT_S = 0.03
"""Maximum seconds that an image of a recording waits before the edge's loop continues: one frame."""
_MAX_TRIANGLES = 50_000
"""Maximum number of triangles of the resulting mesh. With this number a chair is still accurate to a
millimetre."""

Phase = Literal["scanning", "paused", "finishing", "done", "failed"]
_PHASE_AFTER: dict[str, Phase] = {"pause": "paused", "go on": "scanning", "done": "finishing"}
"""The phase of the scan that starts as soon as an order arrives."""
Cast = Callable[[Mesh, str, ScannedPerson | None], Any]
"""Function that creates a character's actor.

Its arguments are a mesh, the actor's id, and the scanned person (None for an object)."""


@dataclass
class ScanRun:
    """The state that "undo" restores: the surface, the scan log, and the state of a moved object."""

    scanner: Scanner | MovedScanner
    scan_log: ScanLog
    thing: MovedObjectState = field(default_factory=MovedObjectState)


def scan_settings(order: Scan) -> ScanSettings:
    """Returns the settings of a scan that a viewer requested."""
    volume = VolumeSettings(voxel=order.voxel)
    if order.mode is ScanMode.PERSON:
        return settings_within(replace(volume, reach=MAX_PERSON_DISTANCE_M), MAX_PERSON_DISTANCE_M)
    return ScanSettings(volume=volume) if order.within is None else settings_within(volume, order.within)


def _create_scanner(order: Scan) -> Scanner | MovedScanner:
    """Returns the scanner that fuses the images of a scan."""
    settings = scan_settings(order)
    if order.mode is ScanMode.PERSON:
        return PersonScanner(settings)
    if order.mode is ScanMode.TURNED:
        return MovedScanner(object_tracking_settings(settings))
    return MovedScanner(settings) if order.mode is ScanMode.MOVED else Scanner(settings)


class LiveScan(threading.Thread):
    """One scan. The edge's loop passes images to it and collects messages from it.

    Args:
        number: the scan's number.
        order: the viewer's request, with the name of the resulting character.
        cast: creates the actor, on the thread of this scan.

    Attributes:
        actor: the scanned character for the stage when it is done. The edge's loop takes it from here.
    """

    def __init__(self, number: int, order: Scan, cast: Cast) -> None:
        super().__init__(name="scan", daemon=True)
        self.number, self.order, self.actor = number, order, None
        self._cast = cast
        thing = MovedObjectState("person" if order.mode is ScanMode.PERSON else "")
        self._run = ScanRun(_create_scanner(order), ScanLog(), thing)
        self._checkpoints: Checkpoints[ScanRun] = Checkpoints()
        self._preview, self._placement = SurfacePreview(number), ScanPlacement()
        self._frame: DepthFrame | None = None
        self._orders: deque[Scan] = deque()
        self._messages: deque[ScanMessage | ScanPieceMessage] = deque()
        self._wake, self._ended = threading.Condition(), False
        self.phase: Phase = "scanning"
        self._tracking, self._now_ns, self._note = "", 0, ("", "")
        self._camera: Float | None = None
        self._last_progress_at = self._last_preview_at = 0.0
        self._shows_object_only = False
        self._ends, self._joints = list[float](), list[float]()

    def offer_image(self, frame: DepthFrame, *, waits: bool = False) -> bool:
        """Passes the newest image to the scan.

        It replaces an image that was not used yet, or waits briefly if ``waits`` is True.

        Returns:
            False if the caller must pass it again, because the previous image is still waiting.
        """
        with self._wake:
            waits = waits and self.phase == "scanning"
            if waits and not self._wake.wait_for(lambda: self._frame is None, _MAX_WAIT_S):
                return False
            self._frame = frame
            self._wake.notify_all()
        return True

    def queue_order(self, order: Scan) -> None:
        """Queues a viewer's order.

        Raises:
            InputError: if it cannot be carried out now.
        """
        if self.phase == "finishing":
            raise InputError(
                "the mesh is being created", where="scan", remedy="Wait until the mesh is on the stage."
            )
        if order.do == "undo" and not self._checkpoints.count_restorable_seconds(self._now_ns):
            raise InputError("there is nothing to undo", where="scan", remedy="Cancel the scan, or continue.")
        next_phase = _PHASE_AFTER.get(order.do)
        if next_phase is not None and (order.do != "pause" or self.phase == "scanning"):
            # Change the phase immediately, because the thread may need seconds for a large surface.
            self.phase, self._note = next_phase, ("", "")
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
                    self._execute(order)
                elif frame is not None and self.phase == "scanning":
                    self._fuse_image(frame)
            except EnlivenError as error:
                self._report_failure(error)
            except Exception as error:  # The edge must continue to run, so the scan only reports the error.
                log.exception("the scan failed")
                remedy = "Cancel the scan, and scan again. The log of the edge contains the details."
                self._report_failure(
                    InputError(f"the scan failed{error_location(error)}", where="scan", remedy=remedy)
                )
            self._queue_messages()

    def _fuse_image(self, frame: DepthFrame) -> None:
        """Fuses an image with the surface."""
        run = self._run
        result = run.scanner.add(frame)
        if isinstance(result, MovedStep):
            step = self._update_moved_object(result, frame.time_ns)
        else:
            step, self._camera = result, result.world_from_camera
            run.scan_log.add(step, frame.time_ns)
        self._tracking, self._now_ns = step.state.value, frame.time_ns
        if step.state is ScanState.SCANNING:
            self._checkpoints.store_if_due(run, frame.time_ns, run.scanner.megabytes)

    def _update_moved_object(self, added: MovedStep, time_ns: int) -> ScanStep:
        """Updates the state of a moved object. Returns the result of the image."""
        moved_object, places = self._run.thing, self._run.thing.places
        moved_object.update(added, time_ns)
        if moved_object.places != places:
            # The camera is now in another room frame. So its placement must be sent immediately.
            self._last_preview_at = 0.0
        is_placed = added.state in (ObjectState.RESTING, ObjectState.FOLLOWED)
        self._camera = added.scan.world_from_camera if is_placed else None
        self._run.scan_log.add(added.scan_step, time_ns)
        return added.scan_step

    def _execute(self, order: Scan) -> None:
        """Carries out a viewer's order."""
        self._note = ("", "")
        if order.do == "undo":
            checkpoint = self._checkpoints.restore(self._now_ns)
            self._run = checkpoint or self._run
            room = create_scan_view(self._run.scanner).room_scanner
            self._camera = room.poses[-1][1] if room is not None and room.poses else None
        elif order.do == "done":
            self._finish(order)

    def _finish(self, order: Scan) -> None:
        """Creates the character from the scan."""
        run, name = self._run, self.order.name or "scan"
        run.scan_log.raise_scan_error("scan", run.scanner)
        scan_result = finish_scan(run.scanner, self._select_kept_part(order), _MAX_TRIANGLES, name)
        self.actor = self._cast(scan_result.mesh, name, scan_result.person)
        if scan_result.person is not None:
            settings = self.actor.settings
            self._ends, self._joints = (
                [x for group in groups for x in group] for groups in (settings.ends, settings.joints)
            )
        places = [] if order.whole else describe_places(run.scanner)
        self._note = _split_note([*places, *run.scan_log.advice(run.scanner)], scan_result.cut_note)
        self.phase = "done"

    def _select_kept_part(self, order: Scan) -> KeptPart:
        """Returns the part of the scan that the viewer wants to keep."""
        if order.box:
            low, high = np.array(order.box, float).reshape(2, 3)
            frame = np.vstack([np.array(order.stage_from_scan).reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])
            return KeptPart("box", low, high, frame)
        if order.whole:
            return KeptPart("all")
        return KeptPart("alone" if self.order.mode is ScanMode.NEAR else "thing")

    def _report_failure(self, error: EnlivenError) -> None:
        """Reports an error. A viewer can continue the scan."""
        # The advice for the command line names an option. In a window the user presses a button instead.
        self._note = error.what[:160], error.remedy.replace("add --whole to keep", "keep")[:160]
        self.phase = "failed"

    def _queue_messages(self) -> None:
        """Queues a progress message and the changed chunks of the surface."""
        now, scanner = time.monotonic(), self._run.scanner
        if now - self._last_preview_at >= _PREVIEW_INTERVAL_S and self.phase in (
            "scanning",
            "paused",
            "failed",
        ):
            elapsed, self._last_preview_at = min(now - self._last_preview_at, 1.0), now
            view = create_scan_view(scanner)
            if view.alone is not self._shows_object_only:
                self._shows_object_only = view.alone
                self._preview.resend_all()
            self._messages.extend(self._preview.changes(view.volume, round(_MAX_BYTES_PER_SECOND * elapsed)))
            self._placement.update(view)
        if now - self._last_progress_at >= _PROGRESS_INTERVAL_S or self.phase == "done":
            self._last_progress_at = now
            self._messages.append(self._message())

    def _message(self) -> ScanMessage:
        scan_log, placement, scanner = self._run.scan_log, self._placement, self._run.scanner
        missing = scanner.missing if isinstance(scanner, PersonScanner) else placement.missing
        return ScanMessage(
            number=self.number,
            phase=self.phase,
            tracking=self._tracking,
            time_ns=self._now_ns,
            fused=scan_log.counts[ScanState.SCANNING],
            way=scan_log.path_length_m,
            full=scanner.is_full,
            undoable=self._checkpoints.count_restorable_seconds(self._now_ns),
            missing=missing,
            stage_from_scan=placement.rows(),
            stage_from_camera=[] if self._camera is None else placement.rows(self._camera),
            view=[] if self._camera is None else placement.view,
            character=(self.order.name or "") if self.phase == "done" else "",
            note=self._note[0],
            remedy=self._note[1],
            thing=self._run.thing.word,
            seconds=self._run.thing.seconds,
            places=self._run.thing.places,
            ends=self._ends if self.phase == "done" else [],
            joints=self._joints if self.phase == "done" else [],
        )


def _split_note(sentences: list[str], default: str) -> tuple[str, str]:
    """Returns the first of several sentences, split into a note and its remedy."""
    note, _, remedy = (sentences[0] if sentences else default).partition(". ")
    return note[:160], remedy[:160]
