"""The preview surface of a running scan, assembled from the pieces that the edge sends."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from enliven.arrays import Float, Float32, Int32, UInt8
from enliven.meshes import Mesh
from enliven.wire import ScanPieceMessage
from enliven_viewer.studio.picture import ScanPreview
from enliven_viewer.theme import PLAIN_SURFACE


class ScanPreviewMesh:
    """The newest version of every piece, joined into one surface.

    Attributes:
        picture: the surface to draw, in the scan's world; None without a surface. A change creates a new
            object.
    """

    def __init__(self) -> None:
        self._pieces: dict[str, ScanPieceMessage] = {}
        self.picture: ScanPreview | None = None

    def update(self, newest: Mapping[str, ScanPieceMessage], number: int) -> bool:
        """Takes the newest message of each piece of a scan. Returns whether anything changed."""
        pieces = {key: piece for key, piece in newest.items() if piece.number == number and piece.seen}
        same = len(pieces) == len(self._pieces)
        if same and all(self._pieces.get(key) is piece for key, piece in pieces.items()):
            return False
        self._pieces = pieces
        self.picture = _join_pieces(list(pieces.values())) if pieces else None
        return True

    @property
    def bounds(self) -> Float | None:
        """Returns (2, 3) metres, the bounds in the scan's world without outliers; None without a surface."""
        if self.picture is None:
            return None
        return np.asarray(np.quantile(self.picture.vertices, [0.02, 0.98], axis=0), float)


def _join_pieces(pieces: list[ScanPieceMessage]) -> ScanPreview:
    """Returns the pieces joined into one surface that is smooth across the seams."""
    vertices: list[Float32] = []
    faces: list[Int32] = []
    colours: list[UInt8] = []
    count = 0
    for piece in pieces:
        steps = np.frombuffer(piece.vertices, "<u2").reshape(-1, 3)
        piece_faces = np.frombuffer(piece.faces, "<u2").reshape(-1, 3).astype(np.int32)
        piece_faces = piece_faces[(piece_faces < len(steps)).all(1)]
        vertices.append((steps + np.array(piece.place, float) * piece.side).astype(np.float32) * piece.step)
        faces.append(piece_faces + count)
        piece_colours = np.frombuffer(piece.colours, np.uint8).reshape(-1, 3)
        colours.append(
            piece_colours
            if len(piece_colours)
            else np.tile(np.array(PLAIN_SURFACE, np.uint8), (len(steps), 1))
        )
        count += len(steps)
    points, joined = np.concatenate(vertices), np.concatenate(faces)
    seen = np.concatenate([np.frombuffer(piece.seen, np.uint8) for piece in pieces])
    return ScanPreview(points, _compute_normals(points, joined), np.concatenate(colours), seen, joined)


def _compute_normals(vertices: Float32, faces: Int32) -> Float32:
    """Returns (V, 3) unit normals. Coincident vertices of neighbouring pieces share one normal."""
    _, place = np.unique(np.round(vertices * 1e4).astype(np.int64), axis=0, return_inverse=True)
    place = place.reshape(-1)
    whole = Mesh(vertices.astype(float), faces).face_vectors()
    total = np.zeros((int(place.max(initial=-1)) + 1, 3))
    for axis in range(3):
        for corner in range(3):
            total[:, axis] += np.bincount(place[faces[:, corner]], whole[:, axis], len(total))
    lengths = np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)
    return np.asarray((total / lengths)[place], np.float32)
