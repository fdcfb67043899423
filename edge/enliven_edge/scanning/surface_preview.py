"""Live preview of a scan: sends the chunks of the surface that changed, limited to the network's
bandwidth.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int
from enliven.scanning import PIECE_STEPS, PieceSums, ScanPiece, TsdfVolume, extract_piece, sum_pieces
from enliven.wire import MAX_PIECE_FACES, MAX_PIECE_VERTICES, ScanPieceMessage

_MIN_CHANGE = 0.25
"""Minimum change before a chunk is sent again. The value means that the weights grew by a fifth, or that a
quarter of the voxels are new."""
_MAX_PIECES = 2000
"""Maximum number of displayed chunks: a hall at 1 cm. A viewer that connects late receives all of them at
once."""

Place = tuple[int, int, int]


class SurfacePreview:
    """Tracks which chunks of the preview surface viewers have already received.

    Args:
        number: the scan's number.
    """

    def __init__(self, number: int) -> None:
        self._number = number
        self._sent: dict[Place, tuple[int, float]] = {}

    def resend_all(self) -> None:
        """Marks every chunk to be sent again, because another surface replaces the current one."""
        self._sent = dict.fromkeys(self._sent, (0, 0.0))

    def changes(self, volume: TsdfVolume, max_bytes: int) -> list[ScanPieceMessage]:
        """Returns the chunks that changed most since they were last returned, about ``max_bytes`` bytes in
        total.
        """
        sums = sum_pieces(volume)
        places = [_place(row) for row in sums.places]
        messages = [
            self._removal_message(place, volume.band.voxel) for place in self._sent.keys() - set(places)
        ]
        amounts = self._measure_change(places, sums)
        for k in np.argsort(-amounts, kind="stable"):
            place = places[k]
            if max_bytes <= 0 or amounts[k] < _MIN_CHANGE:
                break
            if place not in self._sent and len(self._sent) >= _MAX_PIECES:
                continue
            self._sent[place] = int(sums.counts[k]), float(sums.weights[k])
            message = message_from_piece(
                extract_piece(volume, place, sums.blocks[sums.piece == k]), self._number
            )
            max_bytes -= len(message.vertices) + len(message.seen) + len(message.faces) + len(message.colours)
            messages.append(message)
        return messages

    def _measure_change(self, places: list[Place], sums: PieceSums) -> Float:
        """Returns the change (P,) of each chunk: doublings of its weight, plus its fraction of new voxels."""
        sent_values = np.array([self._sent.get(place, (0, 0.0)) for place in places], float).reshape(-1, 2)
        weight_change = np.abs(np.log2((sums.weights + 1.0) / (sent_values[:, 1] + 1.0)))
        return np.asarray(
            weight_change
            + np.abs(sums.counts - sent_values[:, 0]) / np.maximum(sums.counts, sent_values[:, 0])
        )

    def _removal_message(self, place: Place, voxel: float) -> ScanPieceMessage:
        """Returns the message that removes a chunk without a surface."""
        del self._sent[place]
        return ScanPieceMessage(self._number, place, PIECE_STEPS, voxel)


def _place(row: Int) -> Place:
    """Returns a row of block indices as Python integers for a message."""
    return int(row[0]), int(row[1]), int(row[2])


def message_from_piece(piece: ScanPiece, number: int) -> ScanPieceMessage:
    """Returns a chunk as a message. If it exceeds the message limits, only its first faces are kept."""
    faces = piece.faces[(piece.faces < MAX_PIECE_VERTICES).all(1)][:MAX_PIECE_FACES]
    kept_rows = slice(0, MAX_PIECE_VERTICES)
    return ScanPieceMessage(
        number,
        piece.place,
        PIECE_STEPS,
        piece.step,
        piece.places[kept_rows].astype("<u2").tobytes(),
        piece.seen[kept_rows].tobytes(),
        faces.astype("<u2").tobytes(),
        b"" if piece.colours is None else piece.colours[kept_rows].tobytes(),
    )
