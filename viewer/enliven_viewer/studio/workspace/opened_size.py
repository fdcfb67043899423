"""The size at which a model opens: that of the file if people can step into it, else a likelier one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray
from enliven_viewer.language import later, tr

_LEAST = 0.25
"""Metres: a model that is smaller in every direction is taken for another unit."""
_TALLEST = 3.0
"""Metres: a taller model is taken for another unit; the stage is made for people."""
_LONGEST = 4.5
"""Metres: a longer or wider model is taken for another unit: twice a horse."""
_UNITS = (
    ("centimetres", 0.01),
    ("millimetres", 0.001),
    ("kilometres", 1000.0),
    (later("hundreds of metres"), 100.0),
)
"""Units that programs write in place of metres, and metres of each."""
_LIKELY = (0.5, 3.0)
"""Metres: the longest side of a model in a unit that fits: a small dog, a horse with its tail."""
_PERSON = 1.7
"""Metres: height of a model of no likely size, that of a person."""
_WIDEST = 3.5
"""Metres: longest side of such a model."""


@dataclass(frozen=True)
class OpenedSize:
    """How a model is scaled when it is opened.

    Attributes:
        height: metres that it becomes tall.
        note: what was done, for the user; empty if the file's own size is kept.
    """

    height: float
    note: str = ""


def opened_size(points: AnyArray | Sequence[Sequence[float]]) -> OpenedSize:
    """Returns the size for a model with (N, 3) points in the file's metres, +Y up.

    A file that is likely in another unit is read in that unit. Anything else that no person could step into
    becomes as tall as a person.
    """
    extent = np.ptp(np.asarray(points, float), axis=0)
    tall, longest = float(extent[1]), float(extent.max())
    if tall <= 0.0 or (longest >= _LEAST and tall <= _TALLEST and longest <= _LONGEST):
        return OpenedSize(tall)
    for word, metres in _UNITS:
        if _LIKELY[0] <= longest * metres <= _LIKELY[1]:
            note = tr("it was {0:.3g} m tall: read as {1}, {2:.2g} m", tall, tr(word), tall * metres)
            return OpenedSize(tall * metres, note)
    height = min(_PERSON, _WIDEST * tall / longest)
    return OpenedSize(height, tr("it was {0:.3g} m tall, and was made {1:.2g} m tall", tall, height))
