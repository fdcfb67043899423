"""The envelope of a sound, as drawn in the timeline."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float32
from enliven.sounds import SOUND_RATE, Sound

_MAX_SAMPLE = 32767
"""The largest 16-bit sample."""


def compute_envelope(sound: Sound, begin: float, end: float, columns: int) -> Float32:
    """Returns (columns,) the peak level, 0 to 1, in equal parts of the project's time between two seconds."""
    edges = np.linspace(begin - sound.begin, end - sound.begin, columns + 1) * SOUND_RATE
    edges = np.clip(np.round(edges), 0, len(sound.samples)).astype(np.int64)
    loud = np.zeros(columns, np.float32)
    filled = np.flatnonzero(edges[1:] > edges[:-1])
    if len(filled):
        part = np.abs(sound.samples[edges[filled[0]] : edges[filled[-1] + 1]].astype(np.int32))
        starts = edges[filled] - edges[filled[0]]
        loud[filled] = np.maximum.reduceat(part, starts) / _MAX_SAMPLE
    return loud
