"""The view of a running scan for viewers: the growing surface, its room, and the state of a moved object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.meshes import Mesh
from enliven.scanning import GroundPlane, Scanner, TsdfVolume, extract_surface
from enliven.scanning.objects.moved_scanner import MovedScanner
from enliven.scanning.objects.moved_step import MovedStep, ObjectState
from enliven.wire import ThingWord
from enliven_edge.scanning.person import PersonScanner

_FOUND_SHOWN_S = 4.0
"""Seconds of the sensor's clock for which an object that was found again is reported as found."""

_STANDING_AFTER_S = 0.4
"""Seconds of the sensor's clock for which an object must stand still before it is reported as standing."""


@dataclass(frozen=True)
class ScanView:
    """The visible part of a scan.

    Attributes:
        volume: TSDF volume of the growing surface.
        coarse: the same volume with voxels four times as large.
        room_scanner: the scan of the current room; None while the pose of the object in the room is unknown.
        shown_from_room: (4, 4) transform from that room to the frame of the surface.
        alone: whether the surface shows only the object, without a floor.
        places: the number of places in which the object was found.
        ground: the floor in the room's frame, if it is known but not part of the surface.
    """

    volume: TsdfVolume
    coarse: TsdfVolume
    room_scanner: Scanner | None
    shown_from_room: Float
    alone: bool
    places: int
    ground: GroundPlane | None = None

    def mesh(self) -> Mesh:
        """Returns the coarse surface in the room's frame."""
        mesh, rotation = extract_surface(self.coarse), self.shown_from_room[:3, :3]
        return Mesh((mesh.vertices - self.shown_from_room[:3, 3]) @ rotation, mesh.faces)


def create_scan_view(scanner: Scanner | MovedScanner) -> ScanView:
    """Returns the visible part of a scan.

    It is the room with the object, or the object alone after its first move.
    """
    if isinstance(scanner, PersonScanner):
        floor = GroundPlane(np.array([0.0, 1.0, 0.0]), 0.0, 0.0) if scanner.is_on_floor else None
        return ScanView(scanner.volumes[0], scanner.volumes[1], scanner, np.eye(4), True, 1, floor)
    if isinstance(scanner, Scanner):
        return ScanView(scanner.volumes[0], scanner.volumes[1], scanner, np.eye(4), False, 1)
    model, identity = scanner.model, np.eye(4)
    volumes = scanner.rests[0].scanner.volumes if model is None else model.volumes
    room, shown_from_room = scanner.place or (None, identity)
    places = len(scanner.rests)
    return ScanView(volumes[0], volumes[1], room, shown_from_room, model is not None, places)


class MovedObjectState:
    """State of an object that is moved while it is scanned, as a word of :class:`enliven.wire.ScanMessage`.

    Attributes:
        word: "" if it is not separated from the room, "person" if a person is scanned. Otherwise "stands",
            "carried", "settling", "sought", "found", "turning" or "lost".
        seconds: seconds of the sensor's clock that the search for the object took or takes.
        places: number of places in which the object was found.
    """

    def __init__(self, word: ThingWord = "") -> None:
        self.word = word
        self.seconds, self.places = 0.0, 1
        self._still_ns: int | None = None
        self._found_ns: int | None = None

    def update(self, step: MovedStep, time_ns: int) -> None:
        """Updates the state from the result of one image."""
        if step.rests > self.places:
            self.places, self._found_ns = step.rests, time_ns
        if step.state is ObjectState.SETTLING:
            self._still_ns = time_ns if self._still_ns is None else self._still_ns
            self.seconds = (time_ns - self._still_ns) * 1e-9
            # Wait for a few images, because a slowly carried object seems to stand still for an image or two.
            looked_for: ThingWord = "sought" if step.sought else "settling"
            self.word = looked_for if self.seconds >= _STANDING_AFTER_S else "carried"
            return
        self._still_ns = None
        if step.state is ObjectState.LOST:
            self.word = "lost" if step.followed is not None else "carried"
            return
        if step.state is ObjectState.FOLLOWED:
            self.word = "turning"
            return
        is_recent = self._found_ns is not None and 0 <= time_ns - self._found_ns < _FOUND_SHOWN_S * 1e9
        self.word = "found" if is_recent else "stands"
