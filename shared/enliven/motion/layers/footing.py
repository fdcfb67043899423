"""How the pinned feet of a shape stand while its layers play: each layer may say it for its legs.

    modes = foot_modes(project, shape, pins)        # None where all stand as they are found to
    modes(times) -> (P, T)                          # numbers in enliven.document.FEET

"auto": a foot is held where it is low and slow. "always": wherever it is low; the root comes down as far as
it must, so that it does not slide. "never": no foot is held. "ground": no foot is held, and none is below the
floor. Of several layers that play on one leg the last that says more than "auto" decides; the layer that the
shape travels by speaks for all legs, before them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from enliven.arrays import Float, Int
from enliven.document import FEET, Layer, Project, Shape
from enliven.motion.contact import HeldPin
from enliven.motion.layers.timing import Clocks

_HEARD = 0.5
"""Weight from which on a layer that comes in or goes decides."""


def foot_modes(project: Project, shape: Shape, pins: Sequence[HeldPin]) -> Callable[[Float], Int] | None:
    """What gives how each pinned foot stands at times (T,); None where no layer says more than "auto"."""
    spoken = [one for one in shape.layers if one.feet != "auto" and not one.muted and one.weight > 0.0]
    if not spoken or not pins:
        return None
    clocks = Clocks.of(spoken, [project.takes[one.take] for one in spoken])
    mine = [[_speaks(shape, one, pin) for one in spoken] for pin in pins]
    order = sorted(range(len(spoken)), key=lambda k: spoken[k].id != shape.travel)

    def modes(times: Float) -> Int:
        heard = clocks.played(times).weight * clocks.curves(times) > _HEARD
        found = np.zeros((len(pins), len(times)), np.int64)
        for row, legs in zip(found, mine, strict=True):
            for k in order:
                if legs[k]:
                    row[heard[:, k]] = FEET.index(spoken[k].feet)
        return found

    return modes


def _speaks(shape: Shape, layer: Layer, pin: HeldPin) -> bool:
    """Whether a layer turns a bone of a pinned limb, or carries the whole shape."""
    if layer.id == shape.travel:
        return True
    spans = (span for bone in pin.chain for span in shape.spans[bone])
    return any(ref.layer == layer.id for span in spans for ref in span.refs)
