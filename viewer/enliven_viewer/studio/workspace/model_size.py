"""Chooses the size of an opened model. It is the size in the file if that is plausible, otherwise a likely
size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray
from enliven_viewer.language import later, tr

_MIN_SIZE_M = 0.25
"""Minimum plausible size in metres. The file of a smaller model is assumed to use another unit."""
_MAX_HEIGHT_M = 3.0
"""Maximum plausible height in metres. The file of a taller model is assumed to use another unit, because the
stage is made for people.
"""
_MAX_LENGTH_M = 4.5
"""Maximum plausible length in metres: twice the length of a horse. The file of a longer or wider model is
assumed to use another unit.
"""
_UNITS = (
    ("centimetres", 0.01),
    ("millimetres", 0.001),
    ("kilometres", 1000.0),
    (later("hundreds of metres"), 100.0),
)
"""Units that some programs write instead of metres, with their length in metres."""
_PLAUSIBLE_LENGTHS_M = (0.5, 3.0)
"""Plausible range of a model's longest side in metres, from a small dog to a horse with its tail. A unit is
accepted if the size is in this range.
"""
_PERSON_HEIGHT_M = 1.7
"""Height in metres of a model without a plausible size: the height of a person."""
_MAX_FALLBACK_LENGTH_M = 3.5
"""Maximum length in metres of the longest side of a model that gets the height of a person."""


@dataclass(frozen=True)
class ModelSize:
    """The height to which an opened model is scaled.

    Attributes:
        height: height in metres after scaling.
        note: explanation for the user; empty if the file's own size is kept.
    """

    height: float
    note: str = ""


def choose_size(points: AnyArray | Sequence[Sequence[float]]) -> ModelSize:
    """Returns the size for a model with (N, 3) points in the file's metres, +Y up.

    If another unit gives a plausible size, the file is read in that unit. Otherwise a model of an implausible
    size gets the height of a person.
    """
    extent = np.ptp(np.asarray(points, float), axis=0)
    tall, longest = float(extent[1]), float(extent.max())
    if tall <= 0.0 or (longest >= _MIN_SIZE_M and tall <= _MAX_HEIGHT_M and longest <= _MAX_LENGTH_M):
        return ModelSize(tall)
    for unit_name, metres in _UNITS:
        if _PLAUSIBLE_LENGTHS_M[0] <= longest * metres <= _PLAUSIBLE_LENGTHS_M[1]:
            note = tr("it was {0:.3g} m tall: read as {1}, {2:.2g} m", tall, tr(unit_name), tall * metres)
            return ModelSize(tall * metres, note)
    height = min(_PERSON_HEIGHT_M, _MAX_FALLBACK_LENGTH_M * tall / longest)
    return ModelSize(height, tr("it was {0:.3g} m tall, and was scaled to {1:.2g} m", tall, height))
