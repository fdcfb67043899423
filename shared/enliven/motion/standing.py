"""When the pinned feet of a shape stand: its whole motion played once, free, and watched.

window_of(layers, takes) -> Window                       # the time that has to be watched
found_contacts(pins, window, free) -> [(HeldPin, Contacts)]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float
from enliven.motion.clip import Clip
from enliven.motion.contacts import Contacts, contacts_of, hold
from enliven.motion.layers import Layer
from enliven.motion.pin import HeldPin, pin_limb
from enliven.skeleton import Skeleton

_RATE = 60.0
"""Moments a second at which feet are watched."""
_LONGEST = 120.0
"""Seconds that are watched where layers of unlike lengths are looped; after that no foot is pinned."""


@dataclass(frozen=True)
class Window:
    """The seconds of the project in which a shape's motion is all there is.

    Attributes:
        start: where the first layer begins.
        end: where the last one ends.
        looped: all begin again together at the end.
    """

    start: float
    end: float
    looped: bool

    def folded(self, times: Float) -> Float:
        """The times (T,) within the window that look the same, where all is looped."""
        if not self.looped or self.end <= self.start:
            return times
        return np.asarray(self.start + np.mod(times - self.start, self.end - self.start))


def window_of(layers: Sequence[Layer], takes: Mapping[str, Clip]) -> Window:
    """The window of layers that are played together; of none, no time at all."""
    if not layers:
        return Window(0.0, 0.0, False)
    lengths = [takes[layer.take].duration / abs(layer.speed) for layer in layers]
    start = min(layer.offset for layer in layers)
    end = max(layer.offset + length for layer, length in zip(layers, lengths, strict=True))
    looped = [length for layer, length in zip(layers, lengths, strict=True) if layer.loop]
    if len(looped) == len(layers) and np.ptp(looped) < 1e-9:
        return Window(start, start + looped[0], True)
    return Window(start, max(end, start + _LONGEST) if looped else end, False)


def found_contacts(
    pins: Sequence[HeldPin], window: Window, free: Callable[[Float], tuple[Float, Float]]
) -> list[tuple[HeldPin, Contacts]]:
    """The contacts of each pin, in seconds of the project.

    Args:
        free: gives turns and joints (T, N, 3) at times (T,), with no foot pinned.
    """
    count = int(np.ceil((window.end - window.start) * _RATE)) + 1
    step = (window.end - window.start) / max(count - 1, 1)
    times: Float = window.start + np.arange(count, dtype=np.float64) * step
    _, joints = free(times)
    made = []
    for pin in pins:
        seen = contacts_of(joints[:, pin.chain[-1]], step or 1.0, pin.size, pin.settings)
        made.append((pin, replace(seen, starts=seen.starts + window.start, ends=seen.ends + window.start)))
    return made


def pin_at(
    pin: HeldPin, contacts: Contacts, times: Float, skeleton: Skeleton, turns: Float, joints: Float
) -> None:
    """Pins one foot at times (T,) of the project; changes turns (T, N, 4) and joints (T, N, 3) in place."""
    weights, goals = np.empty(len(times)), np.empty((len(times), 3))
    hold(times, contacts.starts, contacts.ends, contacts.places, pin.settings.blend, weights, goals)
    pin_limb(
        skeleton.parents,
        skeleton.vectors,
        pin.chain,
        pin.middle,
        pin.side,
        pin.kept,
        weights,
        goals,
        turns,
        joints,
    )
