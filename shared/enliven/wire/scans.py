"""The messages of a scan: its progress, and its growing surface."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, Struct, field

from enliven.wire.fields import Count, Metres, Nanoseconds, Number, Sentence, check_length

MAX_PIECE_VERTICES = 8192
"""Maximum number of vertices of a piece. A piece that contains the seat and the back of a chair has a third
of it.
"""
MAX_PIECE_FACES = 16_384
"""Maximum number of triangles of a piece, twice the maximum number of vertices."""
Side = Annotated[int, Meta(ge=-(2**20), le=2**20)]
Matrix = Annotated[list[Number], Meta(min_length=12, max_length=12)]
"""The upper three rows of a transform (4, 4), row by row."""

ThingWord = Literal["", "stands", "carried", "settling", "sought", "found", "turning", "lost", "person"]
"""The state of an object that is moved while it is scanned, see :class:`ScanMessage`."""


class ScanMessage(Struct, array_like=True, frozen=True):
    """The progress of a scan (topic "scan").

    Attributes:
        number: number of the scan, counted from the edge's start. 0 if none was started.
        phase: "off", "scanning", "paused", "finishing", "done" or "failed". In "finishing", the mesh is being
            computed. After "done", ``character`` is on the stage. After "failed", ``note`` contains the
            reason, and the scan can continue.
        tracking: the result of tracking the newest image, a value of :class:`enliven.scanning.ScanState`.
            Empty before the first image.
        time_ns: the sensor's clock.
        fused: number of images that were integrated into the surface.
        way: length of the camera's path, metres.
        full: True if the memory is full, so that no new surface is added.
        undoable: time in seconds that "undo" would remove. 0 if undo is not possible.
        missing: fraction of the nearby surface that was not seen yet, 0..1.
        stage_from_scan: pose of the surface on the stage.
        stage_from_camera: pose of the camera, as in :mod:`enliven.camera`. Empty before the first image.
        view: the next best view: camera position and target, six coordinates in metres on the stage. Empty if
            there is none.
        character: the id of the resulting character, or empty.
        note: one sentence for users, or empty.
        remedy: one sentence about the remedy, or empty.
        thing: the state of an object that is moved while it is scanned, or empty. "stands": the object is at
            rest. "carried": it is carried or lost, and nothing is added to the surface. "settling": something
            was put down, and is compared with the object. "sought": this comparison has not succeeded yet.
            "found": the object was found a moment ago. "turning": the moving object is tracked, and its
            visible part is added. "lost": tracking has failed. "person": a person is scanned, and ``missing``
            is the fraction of the sides that were not seen yet.
        seconds: duration of the search for the object, in seconds, until now or until it was found.
        places: number of places at which the object was found. After the first move, the surface contains
            only the object.
        ends: for the finished scan of a person, fifteen coordinates in metres on the stage: the ends of head,
            left and right hand, left and right foot, if all were seen.
        joints: for the finished scan of a person, sixty coordinates in metres: the twenty joints, if the
            trunk was seen.
    """

    number: Count = 0
    phase: Literal["off", "scanning", "paused", "finishing", "done", "failed"] = "off"
    tracking: Annotated[str, Meta(max_length=32)] = ""
    time_ns: Nanoseconds = 0
    fused: Count = 0
    way: Number = 0.0
    full: bool = False
    undoable: Number = 0.0
    missing: Annotated[float, Meta(ge=0.0, le=1.0)] = 1.0
    stage_from_scan: Matrix = field(default_factory=lambda: [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0])
    stage_from_camera: Annotated[list[Number], Meta(max_length=12)] = field(default_factory=list)
    view: Annotated[list[Number], Meta(max_length=6)] = field(default_factory=list)
    character: Annotated[str, Meta(max_length=64)] = ""
    note: Sentence = ""
    remedy: Sentence = ""
    thing: ThingWord = ""
    seconds: Number = 0.0
    places: Count = 1
    ends: Annotated[list[Number], Meta(max_length=15)] = field(default_factory=list)
    joints: Annotated[list[Number], Meta(max_length=60)] = field(default_factory=list)

    def __post_init__(self) -> None:
        if len(self.ends) not in (0, 15) or len(self.joints) not in (0, 60):
            raise ValueError("ends must contain 15 numbers or none, and joints 60 numbers or none")
        if len(self.stage_from_camera) not in (0, 12) or len(self.view) not in (0, 6):
            raise ValueError("stage_from_camera must contain 12 numbers or none, and view 6 numbers or none")


class ScanPieceMessage(Struct, array_like=True, frozen=True):
    """A block of the growing surface of a scan. It replaces the earlier version of the block (topic "scan
    piece").

    Attributes:
        number: number of the scan.
        place: index (3,) of the piece in the grid of pieces.
        side: length of a piece's side in steps.
        step: length of a step in metres.
        vertices: (V, 3) uint16 in steps from the piece's corner, in the scan's world.
        seen: (V,) uint8, how well each vertex was observed, at most 255.
        faces: (F, 3) uint16.
        colours: (V, 3) uint8 sRGB. Empty without colour.
    """

    number: Count
    place: tuple[Side, Side, Side]
    side: Annotated[int, Meta(ge=1, le=2**16)]
    step: Metres
    vertices: Annotated[bytes, Meta(max_length=6 * MAX_PIECE_VERTICES)] = b""
    seen: Annotated[bytes, Meta(max_length=MAX_PIECE_VERTICES)] = b""
    faces: Annotated[bytes, Meta(max_length=6 * MAX_PIECE_FACES)] = b""
    colours: Annotated[bytes, Meta(max_length=3 * MAX_PIECE_VERTICES)] = b""

    def __post_init__(self) -> None:
        check_length("vertices", self.vertices, 6 * len(self.seen))
        check_length("faces", self.faces, len(self.faces) // 6 * 6)
        if self.colours:
            check_length("colours", self.colours, 3 * len(self.seen))
        if self.faces and int(np.frombuffer(self.faces, "<u2").max()) >= len(self.seen):
            raise ValueError(
                f"a triangle refers to a vertex that does not exist: the block has {len(self.seen)} vertices"
            )
