"""Foot modes: determines the lock mode of the pinned feet of a shape. Each layer may set the mode of the legs
that it moves.

    modes = foot_modes(project, shape, pins)        # None if all use detected contacts
    modes(times) -> (P, T)                          # indices into enliven.document.FEET

"auto": a foot is locked while it is low and slow. "always": a foot is locked whenever it is low, and the root
is lowered as far as necessary, so that the foot does not slide. "never": feet are not locked. "ground": feet
are not locked, but kept above the floor. If several layers affect the same leg, the last one with a mode
other than "auto" determines the mode. The layer that moves the root affects all legs, with lower priority.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from enliven.arrays import Float, Int
from enliven.document import FEET, Layer, Project, RiggedCharacter
from enliven.motion.contact.pin import HeldPin
from enliven.motion.layers.timing import LayerClocks

_MIN_ACTIVE_WEIGHT = 0.5
"""Minimum weight at which a fading layer determines the foot mode."""


def foot_modes(
    project: Project, shape: RiggedCharacter, pins: Sequence[HeldPin]
) -> Callable[[Float], Int] | None:
    """Returns a function from times (T,) to the mode of each pinned foot. Returns None if all layers have the
    mode "auto"."""
    mode_layers = [
        layer for layer in shape.layers if layer.feet != "auto" and not layer.muted and layer.weight > 0.0
    ]
    if not mode_layers or not pins:
        return None
    clocks = LayerClocks.from_layers(mode_layers, [project.takes[layer.take] for layer in mode_layers])
    affects = [[_affects_pinned_limb(shape, layer, pin) for layer in mode_layers] for pin in pins]
    order = sorted(range(len(mode_layers)), key=lambda k: mode_layers[k].id != shape.travel)

    def modes(times: Float) -> Int:
        is_active = clocks.frames_at(times).weight * clocks.weight_curves(times) > _MIN_ACTIVE_WEIGHT
        chosen_modes = np.zeros((len(pins), len(times)), np.int64)
        for row, legs in zip(chosen_modes, affects, strict=True):
            for k in order:
                if legs[k]:
                    row[is_active[:, k]] = FEET.index(mode_layers[k].feet)
        return chosen_modes

    return modes


def _affects_pinned_limb(shape: RiggedCharacter, layer: Layer, pin: HeldPin) -> bool:
    """Returns True if a layer rotates a bone of a pinned limb, or moves the root of the shape."""
    if layer.id == shape.travel:
        return True
    spans = (span for bone in pin.chain for span in shape.spans[bone])
    return any(ref.layer == layer.id for span in spans for ref in span.refs)
