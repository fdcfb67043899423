"""The messages of a scan: how it goes, and the surface as it grows."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, Struct, field

from enliven.wire.fields import Count, Metres, Nanoseconds, Number, Sentence, expect

MAX_PIECE_VERTICES = 8192
"""Vertices of a piece: three times what a chair's seat and back have in one."""
MAX_PIECE_FACES = 16_384
"""Triangles of a piece: twice its vertices."""
Side = Annotated[int, Meta(ge=-(2**20), le=2**20)]
Matrix = Annotated[list[Number], Meta(min_length=12, max_length=12)]
"""The upper three rows of a transform, row by row."""

ThingWord = Literal["", "stands", "carried", "settling", "sought", "found", "turning", "lost", "person"]
"""Where a thing is that is moved while it is scanned, see :class:`ScanMessage`."""


class ScanMessage(Struct, array_like=True, frozen=True):
    """How the scan goes (topic "scan").

    Attributes:
        number: of the scan, counted from the edge's start; 0 where none was begun.
        phase: "off"; "scanning"; "paused"; "finishing": the mesh is made; "done": ``character`` stands on the
            stage; "failed": ``note`` says why, and it can go on.
        tracking: what became of the newest image, a word of :class:`enliven.scanning.ScanState`; empty
            before the first.
        time_ns: the sensor's clock.
        fused: images in the surface.
        way: metres that the camera was carried.
        full: whether the memory is full, so that nothing new is added.
        undoable: seconds that "undo" would take back; 0 where it cannot.
        missing: share of what is near that was not seen yet, 0..1.
        stage_from_scan: where the surface stands on the stage.
        stage_from_camera: the camera, as of :mod:`enliven.camera`; empty before the first image.
        view: from where most of what is missing is seen, and what to look at: six metres on the stage; or
            empty.
        character: the id of what it became, or empty.
        note: one sentence for people, or empty.
        mend: what to do about it.
        thing: of a thing that is moved while it is scanned: it "stands", or lies; is "carried", or lost, and
            nothing is added; "settling": something stands still, and it is looked for in that; "sought": in
            vain so far; was "found" just now; it is "turning" and followed, and what is seen of it is added;
            or was "lost" meanwhile; or it is a "person", and what is missing are the sides not seen yet. Else
            empty.
        seconds: for which it is looked for, or was until it was found.
        places: in which it was found so far; the surface is the thing alone from the first move on.
        ends: of a person that is "done": fifteen metres on the stage, the ends of head, left and right hand,
            left and right foot, where all were seen.
        joints: of the same sixty, its twenty joints, where its trunk was seen.
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
    mend: Sentence = ""
    thing: ThingWord = ""
    seconds: Number = 0.0
    places: Count = 1
    ends: Annotated[list[Number], Meta(max_length=15)] = field(default_factory=list)
    joints: Annotated[list[Number], Meta(max_length=60)] = field(default_factory=list)

    def __post_init__(self) -> None:
        if len(self.ends) not in (0, 15) or len(self.joints) not in (0, 60):
            raise ValueError("five ends have 15 numbers and 20 joints 60, or there are none")
        if len(self.stage_from_camera) not in (0, 12) or len(self.view) not in (0, 6):
            raise ValueError("a camera has 12 numbers and a view 6, or none")


class ScanPieceMessage(Struct, array_like=True, frozen=True):
    """A part of the growing surface, in the place of what it was before (topic "scan piece").

    Attributes:
        number: of the scan.
        place: of the piece, in sides of pieces.
        side: steps of a piece's side.
        step: metres.
        vertices: (V, 3) uint16 in steps from the piece's corner, the scan's world.
        seen: (V,) uint8, 255 where it was seen well.
        faces: (F, 3) uint16.
        colours: (V, 3) uint8 sRGB; empty without.
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
        expect("vertices", self.vertices, 6 * len(self.seen))
        expect("faces", self.faces, len(self.faces) // 6 * 6)
        if self.colours:
            expect("colours", self.colours, 3 * len(self.seen))
        if self.faces and int(np.frombuffer(self.faces, "<u2").max()) >= len(self.seen):
            raise ValueError(f"a triangle has a corner beyond the {len(self.seen)} vertices")
