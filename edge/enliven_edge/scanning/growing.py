"""The growing surface of a scan as messages: pieces that changed, as many as the network is to carry."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int
from enliven.scanning import PIECE_STEPS, DistanceVolume, PieceSums, ScanPiece, piece_of, piece_sums
from enliven.wire import MAX_PIECE_FACES, MAX_PIECE_VERTICES, ScanPieceMessage

_CHANGED = 0.25
"""How much a piece changed before it is sent again: its weights grew by a fifth, or a fourth of it is new."""
_MOST_PIECES = 2000
"""Pieces of a scan that are shown: a hall at 1 cm; a viewer that comes late gets all of them at once."""

Place = tuple[int, int, int]


class GrowingSurface:
    """What viewers were sent of the surface of one scan.

    Args:
        number: of the scan.
    """

    def __init__(self, number: int) -> None:
        self._number = number
        self._sent: dict[Place, tuple[int, float]] = {}

    def anew(self) -> None:
        """Sends every piece once more, as where another surface takes the place of the one before."""
        self._sent = dict.fromkeys(self._sent, (0, 0.0))

    def changes(self, volume: DistanceVolume, most: int) -> list[ScanPieceMessage]:
        """Returns the pieces that changed most since they were returned, of so many bytes in all about."""
        sums = piece_sums(volume)
        now = [_place(row) for row in sums.places]
        found = [self._gone(place, volume.band.voxel) for place in self._sent.keys() - set(now)]
        much = self._much(now, sums)
        for k in np.argsort(-much, kind="stable"):
            place = now[k]
            if most <= 0 or much[k] < _CHANGED:
                break
            if place not in self._sent and len(self._sent) >= _MOST_PIECES:
                continue
            self._sent[place] = int(sums.counts[k]), float(sums.weights[k])
            message = as_message(piece_of(volume, place, sums.blocks[sums.piece == k]), self._number)
            most -= len(message.vertices) + len(message.seen) + len(message.faces) + len(message.colours)
            found.append(message)
        return found

    def _much(self, places: list[Place], sums: PieceSums) -> Float:
        """Returns (P,) how much the pieces changed: by doublings of their weights, and parts of them."""
        before = np.array([self._sent.get(place, (0, 0.0)) for place in places], float).reshape(-1, 2)
        grown = np.abs(np.log2((sums.weights + 1.0) / (before[:, 1] + 1.0)))
        return np.asarray(grown + np.abs(sums.counts - before[:, 0]) / np.maximum(sums.counts, before[:, 0]))

    def _gone(self, place: Place, voxel: float) -> ScanPieceMessage:
        """Returns the message of a piece without a surface."""
        del self._sent[place]
        return ScanPieceMessage(self._number, place, PIECE_STEPS, voxel)


def _place(row: Int) -> Place:
    """Returns a row of places as numbers that a message takes."""
    return int(row[0]), int(row[1]), int(row[2])


def as_message(piece: ScanPiece, number: int) -> ScanPieceMessage:
    """Returns a piece as it is sent; of one that is far too rich the first faces."""
    faces = piece.faces[(piece.faces < MAX_PIECE_VERTICES).all(1)][:MAX_PIECE_FACES]
    kept = slice(0, MAX_PIECE_VERTICES)
    return ScanPieceMessage(
        number,
        piece.place,
        PIECE_STEPS,
        piece.step,
        piece.places[kept].astype("<u2").tobytes(),
        piece.seen[kept].tobytes(),
        faces.astype("<u2").tobytes(),
        b"" if piece.colours is None else piece.colours[kept].tobytes(),
    )
