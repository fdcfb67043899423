"""Scans that viewers request. One scan runs at a time, and its result is put on the stage."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

import msgspec
import numpy as np

from enliven.errors import InputError
from enliven.frames import DepthFrame, Frame
from enliven.meshes import Mesh
from enliven.wire import Scan, ScanMessage, check_character
from enliven_edge.settings import EdgeSettings
from enliven_edge.stage.character_setup import create_mesh_actor
from enliven_edge.stage.stage import Stage
from enliven_edge.stage.stage_capacity import Peer

if TYPE_CHECKING:
    from enliven.possession import Actor
    from enliven_edge.scanning.live_scan import Cast, LiveScan
    from enliven_edge.scanning.person import ScannedPerson

_CHARACTER_GAP_M = 0.4
"""Gap in metres on the floor between a scanned character and the characters on the stage."""


class MessageSink(Protocol):
    """An object that sends messages to viewers."""

    def send(self, message: Any, time_ns: int) -> None:
        """Sends a message to all viewers."""

    def forget(self, topic: str) -> None:
        """Drops the latched messages of a topic, so that viewers that connect later do not get them."""


class _ScanLoader(threading.Thread):
    """A thread that loads the modules of a scan. An edge that never scans does not load them."""

    def __init__(self, number: int, order: Scan, cast: Cast) -> None:
        super().__init__(name="beginning of a scan", daemon=True)
        self._arguments = number, order, cast
        self.scan: LiveScan | None = None

    def run(self) -> None:
        from enliven_edge.scanning.live_scan import LiveScan

        self.scan = LiveScan(*self._arguments)


class Scans:
    """The running scan of an edge.

    Args:
        stage: the stage for the resulting character.
        settings: the edge's settings, for the actor.
    """

    def __init__(self, stage: Stage, settings: EdgeSettings | None = None) -> None:
        self._stage, self._settings = stage, settings or EdgeSettings()
        self._scan: LiveScan | None = None
        self._beginning: _ScanLoader | None = None
        self._number = 0
        self._is_starting = self._is_ending = False
        self._name = ""
        stage.places.watch(self._reserved_ids)

    @property
    def is_active(self) -> bool:
        """Returns True while a scan is running. While it is running, performers are not tracked."""
        is_running = self._scan is not None and self._scan.phase in ("scanning", "paused", "failed")
        return is_running or self._beginning is not None

    def execute_order(self, order: Scan) -> None:
        """Carries out a viewer's order.

        Raises:
            InputError: if it cannot be carried out now.
        """
        if order.do == "start":
            self._start(order)
        elif self._beginning is not None and order.do != "cancel":
            raise InputError("the scan is just starting", where="scan", remedy="Try again in a moment.")
        elif self._scan is None and self._beginning is None:
            raise InputError("no scan is running", where="scan", remedy="Start a scan first.")
        elif order.do == "cancel":
            self.close()
            self._is_ending = True
        elif self._scan is not None:
            self._scan.queue_order(order)

    def offer_frame(self, frame: Frame, *, waits: bool = False) -> bool:
        """Passes a frame to the scan. Returns False if the scan is busy and the caller must pass it again."""
        if self._scan is None or not isinstance(frame, DepthFrame):
            return True
        return self._scan.offer_image(frame, waits=waits)

    def poll(self, sink: MessageSink) -> None:
        """Sends progress to viewers, and puts a finished scan on the stage. Call it once per frame."""
        if self._is_starting or self._is_ending:
            sink.forget("scan piece")
        if self._is_ending:
            sink.send(ScanMessage(self._number), 0)
        if self._is_starting and self._beginning is not None:
            # Start loading here and not in ``ask``. Loading takes long, and the viewer's other requests would
            # have to wait.
            self._beginning.start()
        self._is_starting = self._is_ending = False
        if self._beginning is not None and self._beginning.scan is not None:
            self._scan, self._beginning = self._beginning.scan, None
            self._scan.start()
        scan = self._scan
        if scan is None:
            return
        actor, scan.actor = scan.actor, None
        if actor is not None:
            self._stage.place_actor(actor)
            sink.forget("scan piece")
        for message in scan.messages():
            sink.send(message, getattr(message, "time_ns", 0))

    def close(self) -> None:
        """Ends the scan. An unfinished scan is discarded."""
        if self._scan is not None:
            self._scan.end()
        self._scan = self._beginning = None

    def _start(self, order: Scan) -> None:
        """Starts a scan that replaces a finished or failed one."""
        if self._beginning is not None or (
            self._scan is not None and self._scan.phase not in ("done", "failed")
        ):
            raise InputError(
                "a scan is already running", where="scan", remedy="Finish or cancel the running scan first."
            )
        name = order.name or self._free_name()
        self._stage.places.check(name, None)
        self.close()
        self._number += 1
        self._is_starting, self._name = True, name
        named = msgspec.structs.replace(order, name=name)
        self._beginning = _ScanLoader(self._number, named, self._create_cast())

    def _reserved_ids(self) -> Iterator[tuple[str, Peer | None]]:
        """Yields the id that the scan will have on the stage. The id is reserved for the scan."""
        is_done = self._scan is not None and self._scan.phase == "done"
        if (self._scan is not None or self._beginning is not None) and not is_done:
            yield self._name, None

    def _create_cast(self) -> Cast:
        """Returns a function that makes the actor of a scanned mesh, ready for its first frame."""
        nodes, settings = self._settings.nodes, self._settings.actor

        def cast(mesh: Mesh, name: str, person: ScannedPerson | None) -> Actor:
            offset = np.array([self._find_offset(mesh, name), 0.0, 0.0])
            mesh = replace(mesh, vertices=mesh.vertices + offset)
            ends, joints = (None, None) if person is None else (person.ends + offset, person.bones + offset)
            actor = create_mesh_actor(mesh, name, nodes, settings, fit=False, ends=ends, joints=joints)
            check_character(actor.character)
            actor.warm_up()
            return actor

        return cast

    def _find_offset(self, mesh: Mesh, name: str) -> float:
        """Returns the distance in metres along +X that moves a mesh next to the other characters at rest."""
        other_extents = [
            character.vertices[:, 0].max()
            for mesh_extent, character in self._stage.characters.items()
            if mesh_extent != name
        ]
        return (
            float(max(other_extents) + _CHARACTER_GAP_M - mesh.vertices[:, 0].min()) if other_extents else 0.0
        )

    def _free_name(self) -> str:
        """Returns "scan", or the first of "scan 2", "scan 3", ... that is unused on the stage."""
        names, number = self._stage.characters, 1
        while (name := "scan" if number == 1 else f"scan {number}") in names:
            number += 1
        return name
