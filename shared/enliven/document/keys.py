"""Keyframes: rotations and displacements that an artist sets at certain times, and the curves that
interpolate them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.errors import InputError

KEY_STEP = 1.0 / 30.0
"""Frame duration, in seconds, of takes that are computed from keys. Key times are rounded to these frames."""
_MAX_KEY_S = 3600.0
"""Maximum time of a key in seconds: one hour, or about 100,000 frames."""
EASES: tuple[str, ...] = ("smooth", "linear", "step")
"""Interpolation from a key to the next key: smooth (continuous speed without overshoot), linear, or step."""
_BISECTION_STEPS = 60
"""Number of bisection steps in the search for a time. They reduce an interval of a thousand seconds to the
rounding error."""


@dataclass(frozen=True)
class MotionKey:
    """A keyframe: the rotation and displacement of a bone, a node or a whole character at a time.

    Attributes:
        second: time in the take.
        degrees: rotation vector in degrees, in the axes of the rest pose.
        ease: interpolation to the next key.
        metres: displacement in metres, in the axes of the rest pose. It is zero for a bone, because bones are
            only rotated.
    """

    second: float
    degrees: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ease: str = "smooth"
    metres: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("degrees", "metres"):
            object.__setattr__(self, name, tuple(float(number) for number in getattr(self, name)))
        problem = ""
        if not 0.0 <= self.second <= _MAX_KEY_S or not all(map(math.isfinite, (*self.degrees, *self.metres))):
            problem = (
                f"a key of {self.degrees} degrees and {self.metres} m at {self.second} s has an "
                "invalid time or value"
            )
        elif self.ease not in EASES or len(self.degrees) != 3 or len(self.metres) != 3:
            problem = (
                f"a key of {self.degrees} degrees and {self.metres} m with the interpolation "
                f"{self.ease!r} is not valid"
            )
        if problem:
            advice = (
                "Pass a time of at least 0 s, three angles, three lengths in metres, and one of these "
                f"interpolations: {', '.join(EASES)}."
            )
            raise InputError(problem, where="key", remedy=advice)


def sort_keys(keys: Sequence[MotionKey], where: str) -> tuple[MotionKey, ...]:
    """Returns the keys in the order of time, with times rounded to frames.

    Raises:
        InputError: without a key, or if two keys are on the same frame.
    """
    frame_keys = sorted(((round(key.second / KEY_STEP), key) for key in keys), key=lambda one: one[0])
    if not frame_keys or len({frame for frame, _ in frame_keys}) < len(frame_keys):
        problem = "two keys are on the same frame" if frame_keys else "the list of keys is empty"
        raise InputError(
            problem, where=where, remedy="Pass at least one key, and each key on a different frame."
        )
    return tuple(replace(key, second=frame * KEY_STEP) for frame, key in frame_keys)


def key_values(keys: Sequence[MotionKey], seconds: AnyArray) -> Float:
    """Returns the values (T, 6) at seconds (T,): a rotation vector in degrees, and a displacement in
    metres.
    """
    values = np.array([(*key.degrees, *key.metres) for key in keys], np.float64)
    return interpolate_keys([key.second for key in keys], values, [key.ease for key in keys], seconds)


def interpolate_keys(at: Sequence[float], values: Float, eases: Sequence[str], seconds: AnyArray) -> Float:
    """Interpolates C channels through values (K, C) at times ``at`` (K,). Returns values (T, C) at times
    ``seconds`` (T,).

    Before the first and after the last key the values are constant. Smooth pieces are cubic, with the
    monotone slopes of Fritsch and Carlson (1980), which do not overshoot.
    """
    times = np.asarray(at, np.float64)
    seconds = np.clip(np.asarray(seconds, np.float64), times[0], times[-1])
    if len(times) == 1:
        return np.repeat(values, len(seconds), axis=0)
    # A frame gets the exact value of a key if their times differ only by rounding errors.
    piece = np.clip(np.searchsorted(times, seconds + 1e-9, side="right") - 1, 0, len(times) - 2)
    durations = np.diff(times)[:, None]
    slopes = _key_slopes(durations, np.diff(values, axis=0) / durations)
    u = np.clip((seconds - times[piece]) / durations[piece, 0], 0.0, 1.0)[:, None]
    ease = np.array(eases)[piece][:, None]
    value_before, value_after, span = values[piece], values[piece + 1], durations[piece]
    cubic = (
        (2 * u**3 - 3 * u**2 + 1) * value_before
        + (u**3 - 2 * u**2 + u) * span * slopes[piece]
        + (3 * u**2 - 2 * u**3) * value_after
        + (u**3 - u**2) * span * slopes[piece + 1]
    )
    step = np.where(u < 1.0, value_before, value_after)
    return np.select(
        [ease == "smooth", ease == "linear"], [cubic, value_before + u * (value_after - value_before)], step
    )


def _key_slopes(durations: Float, steep: Float) -> Float:
    """Computes the slopes (K, C) at K keys from the durations (K - 1, 1) and gradients (K - 1, C) of the
    pieces between them.

    The slope is 0 at the first and last key, and at keys at which a channel changes direction.
    """
    previous_gradients, next_gradients = steep[:-1], steep[1:]
    first, second = 2 * durations[1:] + durations[:-1], durations[1:] + 2 * durations[:-1]
    on = previous_gradients * next_gradients > 0.0
    mean = (first + second) / (
        first / np.where(on, previous_gradients, 1.0) + second / np.where(on, next_gradients, 1.0)
    )
    zero_slopes = np.zeros((1, steep.shape[1]))
    return np.concatenate([zero_slopes, np.where(on, mean, 0.0), zero_slopes])


@dataclass(frozen=True)
class CurveKey:
    """A keyframe of a layer attribute.

    Attributes:
        second: time of the project in seconds, relative to the start of the layer's lane.
        value: a weight from 0 to 1, or a speed factor.
        ease: interpolation to the next key.
    """

    second: float
    value: float
    ease: str = "smooth"

    def __post_init__(self) -> None:
        if not (math.isfinite(self.second) and math.isfinite(self.value) and self.ease in EASES):
            problem = (
                f"a key with the value {self.value} at {self.second} s and the interpolation "
                f"{self.ease!r} is not valid"
            )
            raise InputError(
                problem,
                where="key",
                remedy="Pass a finite time, a finite value, and one of these interpolations: "
                f"{', '.join(EASES)}.",
            )


class Curve:
    """A curve through keys, and its integral. Before the first and after the last key, the curve is constant.

    Args:
        keys: at least one key, in the order of time.
    """

    def __init__(self, keys: Sequence[CurveKey]) -> None:
        self._at = np.array([key.second for key in keys])
        self._values = np.array([key.value for key in keys])
        self._eases = [key.ease for key in keys]
        durations = np.diff(self._at)
        steep = np.diff(self._values) / durations
        self._slopes = (
            _key_slopes(durations[:, None], steep[:, None])[:, 0] if len(durations) else np.zeros(1)
        )
        piece_integrals = [self._integrals_within(piece, np.ones(1))[0] for piece in range(len(durations))]
        self._sums = np.concatenate([[0.0], np.cumsum(piece_integrals)])

    def __call__(self, seconds: AnyArray | Sequence[float]) -> Float:
        """Returns (T,) values at seconds (T,)."""
        times = np.asarray(seconds, np.float64)
        return interpolate_keys(self._at.tolist(), self._values[:, None], self._eases, times)[:, 0]

    def integrate(self, seconds: AnyArray | Sequence[float]) -> Float:
        """Returns the integrals (T,) from 0 to seconds (T,)."""
        seconds = np.asarray(seconds, np.float64)
        integrals = self._from_first(np.append(seconds, 0.0))
        return np.asarray(integrals[:-1] - integrals[-1])

    def time_at_integral(self, area: float) -> float:
        """Returns the time, in seconds, at which the integral from 0 equals ``area``. The curve must be above
        0 everywhere.
        """
        bound = abs(area) / float(self._values.min()) + 1e-9
        low, high = -bound, bound
        for _ in range(_BISECTION_STEPS):
            middle = (low + high) / 2.0
            low, high = (middle, high) if self.integrate(np.array([middle]))[0] < area else (low, middle)
        return (low + high) / 2.0

    def _from_first(self, seconds: Float) -> Float:
        """Returns the integrals (T,) from the first key to seconds (T,)."""
        integral_before = self._values[0] * np.minimum(seconds - self._at[0], 0.0)
        integral_after = self._values[-1] * np.maximum(seconds - self._at[-1], 0.0)
        outside = integral_before + integral_after
        clamped = np.clip(seconds, self._at[0], self._at[-1])
        piece = np.clip(np.searchsorted(self._at, clamped, side="right") - 1, 0, max(len(self._at) - 2, 0))
        if len(self._at) > 1:
            fraction = (clamped - self._at[piece]) / np.diff(self._at)[piece]
            within_pieces = [
                self._integrals_within(int(k), np.array([u]))[0] for k, u in zip(piece, fraction, strict=True)
            ]
            outside = outside + self._sums[piece] + np.array(within_pieces)
        return np.asarray(outside)

    def _integrals_within(self, piece: int, u: Float) -> Float:
        """Computes the integral of a piece from its first key to the fraction u (T,) of the piece (Hermite
        cubics).
        """
        duration = self._at[piece + 1] - self._at[piece]
        value_before, value_after = self._values[piece], self._values[piece + 1]
        if self._eases[piece] == "step":
            return np.asarray(duration * value_before * u)
        if self._eases[piece] == "linear":
            return np.asarray(duration * (value_before * u + (value_after - value_before) * u**2 / 2))
        slopes = self._slopes[piece : piece + 2] * duration
        values = (u**4 / 2 - u**3 + u) * value_before + (u**3 - u**4 / 2) * value_after
        return np.asarray(
            duration
            * (values + (u**4 / 4 - 2 * u**3 / 3 + u**2 / 2) * slopes[0] + (u**4 / 4 - u**3 / 3) * slopes[1])
        )


@lru_cache(maxsize=256)
def curve_from_keys(keys: tuple[CurveKey, ...]) -> Curve:
    """Returns the curve through keys, from a cache."""
    return Curve(keys)
