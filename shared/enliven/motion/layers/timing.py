"""The frame of its take that a layer plays at a time of the project.

    frames_of(layer, clip, seconds) -> (T,)
    Clocks.of(layers, clips).frames(seconds) -> (T, L)

Frame numbers may be between two frames, and never beyond the first or the last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Clip, Layer
from enliven.kernels import njit


@dataclass(frozen=True, eq=False)
class Clocks:
    """How layers play their takes: a row (offset, speed, looped, step, frames) each.

    Attributes:
        rows: (L, 5) float64; offset and step in seconds, looped 0 or 1.
    """

    rows: Float

    @staticmethod
    def of(layers: Sequence[Layer], clips: Sequence[Clip]) -> Clocks:
        """The clocks of layers that play these takes."""
        rows = [
            (layer.offset, layer.speed, float(layer.loop), clip.step, float(len(clip.turns)))
            for layer, clip in zip(layers, clips, strict=True)
        ]
        return Clocks(np.array(rows, np.float64).reshape(-1, 5))

    def frames(self, seconds: Float) -> Float:
        """(T, L) frame numbers in [0, F - 1], fractions between frames, at times (T,) of the project."""
        out = np.empty((len(seconds), len(self.rows)))
        played_frames(seconds, self.rows, out)
        return out

    def rounds(self, seconds: Float) -> Float:
        """(T, L) how many times a looped take was played to its end before; 0 for one that is not looped."""
        offset, speed, looped, step, frames = self.rows.T
        length = (frames - 1.0) * step
        played = (seconds[:, None] - offset) * speed + np.where(speed < 0.0, length, 0.0)
        whole = np.floor(played / np.where(length > 0.0, length, 1.0))
        return np.asarray(np.where((looped > 0.0) & (length > 0.0), whole, 0.0))


def frames_of(layer: Layer, clip: Clip, seconds: AnyArray) -> Float:
    """(T,) the frame numbers of the take that a layer plays at ``seconds`` (T,) of the project.

    u = (t - offset) speed, from the end backwards where the speed is below 0; before its begin and after its
    end a take stands still, unless it is looped.
    """
    times = np.ascontiguousarray(np.atleast_1d(seconds), np.float64)
    return Clocks.of([layer], [clip]).frames(times)[:, 0]


@njit(cache=True, nogil=True)
def played_frames(seconds, rows, out):  # type: ignore[no-untyped-def]
    """Kernel: ``out`` (T, L) takes the frame numbers at ``seconds`` (T,) of layers with clocks ``rows``."""
    for t in range(len(seconds)):
        for i in range(len(rows)):
            offset, speed, looped, step, frames = rows[i]
            last = frames - 1.0
            duration = last * step
            played = (seconds[t] - offset) * speed
            if speed < 0.0:
                played += duration
            if looped > 0.0 and duration > 0.0:
                played -= np.floor(played / duration) * duration
            out[t, i] = min(max(played / step, 0.0), last)
