"""Foot lock: detects when the pinned feet of a shape stand, and keeps the feet in place during these times.

    find_analysis_window(layers, takes) -> AnalysisWindow        # the time that is analysed
    compute_foot_lock(pins, window, free) -> FootLock            # contacts, and the lowering of the root
    foot_lock.pin_feet(times, travelled, tree, turns, joints)        # pins the feet of a pose, in place

The whole motion is evaluated once without pins, and the feet are analysed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from enliven.arrays import Bool, Float, Int, Int32
from enliven.document import Clip, LayerBase, PoseStream
from enliven.motion.contact.contacts import (
    ALWAYS,
    GROUND,
    Contacts,
    compute_hold_weights,
    find_contacts,
    find_runs,
)
from enliven.motion.contact.pin import HeldPin, pin_limb

_ANALYSIS_RATE_HZ = 60.0
"""Sampling rate of the analysis of feet, in hertz."""
_MAX_LOOPED_ANALYSIS_S = 120.0
"""Maximum analysed duration, in seconds, if layers of different lengths are looped. After this time, feet are
not pinned."""
_MAX_STRETCH_FRACTION = 0.998
"""Maximum extension of a limb, as a fraction of its length. If the foot's position is farther away, the root
is lowered."""


@dataclass(frozen=True)
class AnalysisWindow:
    """The time range of the project that contains all motion of a shape, in seconds.

    Attributes:
        start: start of the first layer.
        end: end of the last layer.
        looped: True if all layers restart together at the end.
    """

    start: float
    end: float
    looped: bool

    def fold_times(self, times: Float) -> Float:
        """Maps times (T,) to the equivalent times within the window if all layers are looped."""
        if not self.looped or self.end <= self.start:
            return times
        return np.asarray(self.start + np.mod(times - self.start, self.end - self.start))


def find_analysis_window(
    layers: Sequence[LayerBase], takes: Mapping[str, Clip | PoseStream]
) -> AnalysisWindow:
    """Returns the window that contains the motion of all given layers. Without layers, the window is
    empty.
    """
    if not layers:
        return AnalysisWindow(0.0, 0.0, False)
    lengths = [layer.compute_loop_duration(takes[layer.take].duration) for layer in layers]
    start = min(layer.offset for layer in layers)
    end = max(layer.offset + length for layer, length in zip(layers, lengths, strict=True))
    looped = [length for layer, length in zip(layers, lengths, strict=True) if layer.loop]
    if len(looped) == len(layers) and np.ptp(looped) < 1e-9:
        return AnalysisWindow(start, start + looped[0], True)
    return AnalysisWindow(start, max(end, start + _MAX_LOOPED_ANALYSIS_S) if looped else end, False)


@dataclass(frozen=True, eq=False)
class FootLock:
    """The contacts of a shape's feet, and the lowering of its root.

    Attributes:
        pins: every pinned foot with its contacts, in seconds of the project.
        grounds: for each of the P pins, the times at which its foot is only kept above the floor. Empty if no
            layer requests this.
        window: the time range that was analysed.
        times: (F,) times of ``root_drops``, seconds.
        root_drops: (F,) lowering of the root at ``times``, metres.
    """

    pins: tuple[tuple[HeldPin, Contacts], ...]
    window: AnalysisWindow
    times: Float
    root_drops: Float
    grounds: tuple[Contacts, ...] = ()

    def pin_feet(
        self, times: Float, travelled: Float, tree: tuple[Int32, Float], turns: Float, joints: Float
    ) -> None:
        """Pins the feet at times (T,) in the window. Changes turns (T, N, 4) and joints (T, N, 3) in place.

        ``tree`` contains the parents of the joints, and the unrotated vectors (T or 1, N, 3), metres, from
        each parent to its joint. ``travelled`` (T, 3) is the displacement of the shape in earlier loops,
        metres.
        """
        drops = np.interp(times, self.times, self.root_drops)
        joints[:, :, 1] -= drops[:, None]
        for pin, contacts in self.pins:
            weights, goals = _contact_weights(pin, contacts, times)
            goals += travelled
            limb = (pin.chain, pin.middle, pin.side, pin.kept)
            pin_limb(*tree, *limb, pin.settings.rise, pin.settings.sink, weights, goals, drops, turns, joints)
        for (pin, _), ground in zip(self.pins, self.grounds, strict=False):
            _lift_sole(pin, 0.0, _contact_weights(pin, ground, times)[0], tree, turns, joints)
        for pin in (pin for pin, _ in self.pins if pin.settings.above):
            _lift_sole(pin, pin.ground, np.ones(len(times)), tree, turns, joints)


def compute_foot_lock(
    pins: Sequence[HeldPin],
    window: AnalysisWindow,
    free: Callable[[Float], tuple[Float, Float]],
    modes: Callable[[Float], Int] | None = None,
) -> FootLock:
    """Computes the contacts of the pinned feet by evaluating the motion of the whole window once.

    Args:
        free: a function that returns rotations (T, N, 4) and joints (T, N, 3) at times (T,), without pinned
            feet.
        modes: a function that returns the foot modes at times (T,) as indices (P, T) into
            :data:`enliven.document.FEET`, one row per pin. None means "auto" for all feet.
    """
    count = int(np.ceil((window.end - window.start) * _ANALYSIS_RATE_HZ)) + 1
    step = (window.end - window.start) / max(count - 1, 1)
    times: Float = window.start + np.arange(count, dtype=np.float64) * step
    _, joints = free(times)
    contacts, drops, grounds = [], np.zeros(count), []
    foot_modes = None if modes is None else modes(times)
    for number, pin in enumerate(pins):
        mode, max_fractions = None, np.full(count, pin.settings.drop)
        if foot_modes is not None:
            mode = foot_modes[number]
            # A foot in the mode "always" must reach its position, even if the root has to be lowered far.
            max_fractions[mode == ALWAYS] = 1.0
            grounds.append(_contacts_from_runs(mode == GROUND, times))
        foot_contacts = find_contacts(joints[:, pin.chain[-1]], step or 1.0, pin.size, pin.settings, mode)
        foot_contacts = replace(
            foot_contacts, starts=foot_contacts.starts + window.start, ends=foot_contacts.ends + window.start
        )
        if pin.settings.above:
            foot_contacts.places[:, 1] = np.maximum(foot_contacts.places[:, 1], pin.ground + pin.stance)
        contacts.append((pin, foot_contacts))
        drops = np.maximum(
            drops, _compute_drops(pin, joints, *_contact_weights(pin, foot_contacts, times), max_fractions)
        )
    blend = max((pin.settings.blend for pin in pins), default=0.0)
    return FootLock(
        tuple(contacts),
        window,
        times,
        _smooth_drops(drops, round(blend / step) if step else 0, window.looped),
        tuple(grounds),
    )


def _contacts_from_runs(flags: Bool, times: Float) -> Contacts:
    """Converts runs of True values in ``flags`` (F,) to contacts, in seconds. A run that includes the first
    or last frame extends to infinity.
    """
    runs, last_frame = find_runs(flags), len(flags) - 1
    starts = np.array([-np.inf if a == 0 else times[a] for a, _ in runs])
    ends = np.array([np.inf if b == last_frame else times[b] for _, b in runs])
    return Contacts(starts, ends, np.zeros((len(runs), 3)))


def _lift_sole(
    pin: HeldPin, floor: float, weights: Float, tree: tuple[Int32, Float], turns: Float, joints: Float
) -> None:
    """Raises a foot with its sole below the height ``floor`` (metres), by the fraction ``weights`` (T,).

    Changes turns (T, N, 4) and joints (T, N, 3) in place.
    """
    lift = weights * np.maximum(floor + pin.sole - joints[:, pin.below, 1].min(1), 0.0)
    if not (lift > 0.0).any():
        return
    goals = joints[:, pin.chain[-1]] + lift[:, None] * [0.0, 1.0, 0.0]
    limb = (pin.chain, pin.middle, pin.side, pin.kept)
    is_raised = np.asarray(lift > 0.0, np.float64)
    pin_limb(*tree, *limb, 0.0, 0.0, is_raised, goals, np.zeros(len(lift)), turns, joints)


def _contact_weights(pin: HeldPin, contacts: Contacts, times: Float) -> tuple[Float, Float]:
    """Returns the lock weights (T,) of a foot at times (T,), and its target positions (T, 3)."""
    weights, goals = np.empty(len(times)), np.empty((len(times), 3))
    compute_hold_weights(
        times, contacts.starts, contacts.ends, contacts.places, pin.settings.blend, weights, goals
    )
    return weights, goals


def _compute_drops(pin: HeldPin, joints: Float, weights: Float, goals: Float, max_fraction: Float) -> Float:
    """Returns the lowering (F,) of the root, metres, that is needed for a limb to reach its contact.

    The result is at most the limb's length times ``max_fraction`` (F,). A hip can be at most sqrt(reach^2 -
    across^2) above the goal, with the horizontal distance ``across``. The reach is slightly less than the
    length of the limb, so that a knee does not snap straight. A limb without contact needs no lowering.
    """
    start, middle, end = (joints[:, pin.chain[i]] for i in (0, pin.middle, -1))
    distance = np.linalg.norm(end - start, axis=1)
    limb = np.linalg.norm(middle - start, axis=1) + np.linalg.norm(end - middle, axis=1)
    goal = goals.copy()
    height_above_goal = end[:, 1] - goals[:, 1]
    goal[:, 1] += pin.settings.rise * np.maximum(height_above_goal, 0.0) + pin.settings.sink * np.minimum(
        height_above_goal, 0.0
    )
    goal = end + weights[:, None] * (goal - end)
    reach = limb * _MAX_STRETCH_FRACTION
    reach = reach + (1.0 - weights) * np.maximum(distance - reach, 0.0)
    horizontal_distance = np.minimum(np.linalg.norm((goal - start)[:, [0, 2]], axis=1), reach)
    needed = start[:, 1] - goal[:, 1] - np.sqrt(reach**2 - horizontal_distance**2)
    return np.asarray(np.clip(needed, 0.0, max_fraction * pin.size))


def _smooth_drops(drops: Float, width: int, looped: bool) -> Float:
    """Returns (F,) a smooth curve that is at least as large as ``drops`` everywhere.

    The curve is the moving maximum over a window, smoothed by a filter of the same width.
    """
    if width < 1 or not drops.any():
        return drops
    mode = "wrap" if looped else "nearest"
    size = 2 * width + 1
    window = np.hanning(size + 2)[1:-1]
    maximum = scipy.ndimage.maximum_filter1d(drops, size, mode=mode)
    return np.asarray(scipy.ndimage.convolve1d(maximum, window / window.sum(), mode=mode))
