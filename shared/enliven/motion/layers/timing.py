"""The time maps of many layers, compiled: the frames of their takes at many times at once.

    Clocks.of(layers, clips).played(seconds) -> (2, T, L)

Frame numbers may be between two frames, and never beyond the first or the last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, TimeMap
from enliven.kernels import njit


@dataclass(frozen=True, eq=False)
class Clocks:
    """How layers play their takes: a row (offset, speed, looped, step, frames) each.

    Attributes:
        rows: (L, 5) float64; offset and step in seconds, looped 0 or 1.
    """

    rows: Float

    @staticmethod
    def of(layers: Sequence[TimeMap], clips: Sequence[Clip]) -> Clocks:
        """The clocks of layers that play these takes."""
        rows = [
            (layer.offset, layer.speed, float(layer.loop), clip.step, float(len(clip.turns)))
            for layer, clip in zip(layers, clips, strict=True)
        ]
        return Clocks(np.array(rows, np.float64).reshape(-1, 5))

    def played(self, seconds: Float) -> Float:
        """What is played at times (T,) of the project.

        Returns:
            (2, T, L): frame numbers in [0, F - 1], fractions between frames; and how many times a looped take
            was played to its end before.
        """
        out = np.empty((2, len(seconds), len(self.rows)))
        _played(seconds, self.rows, out)
        return out


@njit(cache=True, nogil=True)
def _played(seconds, rows, out):  # type: ignore[no-untyped-def]
    """Kernel: ``TimeMap.played`` at ``seconds`` (T,) of layers with clocks ``rows``, into (2, T, L)."""
    for t in range(len(seconds)):
        for i in range(len(rows)):
            offset, speed, looped, step, frames = rows[i]
            last = frames - 1.0
            duration = last * step
            played = (seconds[t] - offset) * speed
            if speed < 0.0:
                played += duration
            rounds = np.floor(played / duration) if looped > 0.0 and duration > 0.0 else 0.0
            played -= rounds * duration
            out[1, t, i] = rounds
            out[0, t, i] = min(max(played / step, 0.0), last)
