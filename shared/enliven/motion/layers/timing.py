"""Compiled time maps of several layers. One call maps many times to the frames of all layers' takes.

    Clocks.of(layers, clips).frames_at(seconds) -> Times

Frame numbers may be fractional. They are clamped to the range from the first to the last frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from enliven.arrays import Float, Int
from enliven.document import Clip, Segment, TimeMap, curve_from_keys, find_clip_run
from enliven.kernels import njit


class Times(NamedTuple):
    """The frames that L layers play at T times. Like :class:`enliven.document.Moment`, but with arrays
    (T, L), and frames instead of seconds.

    The pose at ``frame`` has the weight 1 - ``share``, and the pose at ``other`` has the weight ``share``.
    ``rounds`` is the number of completed loops, and ``weight`` the weight of the layer.
    """

    frame: Float
    other: Float
    share: Float
    rounds: Float
    weight: Float

    @property
    def is_plain(self) -> bool:
        """True if every layer plays a single frame with full weight."""
        return not self.share.any() and bool((self.weight == 1.0).all())


@dataclass(frozen=True, eq=False)
class LayerClocks:
    """The playback parameters of layers.

    Attributes:
        rows: (L, 8) float64: offset, speed, looped, step, frames, extent, held, ease. Times are in seconds,
            and flags are 0 or 1.
        lanes: (S, 6) float64 the segments of all layers: begin, end, first, speed, and the ends of the
            gapless run that contains the segment.
        first: (L + 1,) the index at which the segments of each layer begin.
        layers: the layers, for the curves of their weights and speeds.
        fine: for each layer, the times (K,) of its take's fine frames, or None if its frames are evenly
            spaced.
    """

    rows: Float
    lanes: Float
    first: Int
    layers: tuple[TimeMap, ...]
    fine: tuple[Float | None, ...] = ()

    @staticmethod
    def from_layers(layers: Sequence[TimeMap], clips: Sequence[Clip]) -> LayerClocks:
        """Builds the clocks of layers that play these takes."""
        rows, lanes, counts = [], list[tuple[float, ...]](), [0]
        for layer, clip in zip(layers, clips, strict=True):
            lane, clip_values = (
                layer.lane(clip.duration),
                (float(layer.loop), clip.step, float(len(clip.turns))),
            )
            lane_values = (layer.extent(clip.duration), float(layer.hold), layer.ease)
            rows.append((layer.offset, layer.speed, *clip_values, *lane_values))
            lanes += [_lane_row(lane, number) for number in range(len(lane))]
            counts.append(len(lane))
        first = np.array(list(accumulate(counts)), np.int64)
        table = np.array(rows, np.float64).reshape(-1, 8)
        fine = tuple(None if clip.fine is None else clip.fine.seconds for clip in clips)
        return LayerClocks(table, np.array(lanes).reshape(-1, 6), first, tuple(layers), fine)

    def frames_at(self, seconds: Float) -> Times:
        """Returns the frames at times (T,) of the project. The weights do not include
        :meth:`weight_curves`."""
        played = np.empty((5, len(seconds), len(self.rows)))
        even = np.repeat(seconds[:, None], len(self.rows), 1)
        for number, layer in enumerate(self.layers):
            if layer.speeds:
                even[:, number] = layer.offset + curve_from_keys(layer.speeds).integrate(
                    seconds - layer.offset
                )
        _play_layers(even, self.rows, self.lanes, self.first, played)
        for number, moments in enumerate(self.fine):
            if moments is not None:
                second, frames = played[:2, :, number] * self.rows[number, 3], np.arange(float(len(moments)))
                played[:2, :, number] = np.interp(second, moments, frames)
        return Times(*played)

    def weight_curves(self, seconds: Float) -> Float:
        """Returns the weight curves (T, L) of the layers at times (T,), 1 for a layer without a curve."""
        curves = np.ones((len(seconds), len(self.layers)))
        for number, layer in enumerate(self.layers):
            if layer.weights:
                curves[:, number] = curve_from_keys(layer.weights)(seconds - layer.offset)
        return curves


def _lane_row(lane: Sequence[Segment], number: int) -> tuple[float, ...]:
    segment = lane[number]
    return (segment.begin, segment.end, segment.first, segment.speed, *find_clip_run(lane, number))


@njit(cache=True, nogil=True)
def _play_layers(seconds, rows, lanes, first, out):
    """Computes ``TimeMap.moment`` at ``seconds`` (T, L), which do not contain speed keys. Writes to
    ``out`` (5, T, L), in the order of :class:`Times`.
    """
    for t in range(len(seconds)):
        for i in range(len(rows)):
            offset, speed, looped, step, frames, extent, held, _ = rows[i]
            at = (seconds[t, i] - offset) * speed
            if speed < 0.0:
                at += extent
            rounds = np.floor(at / extent) if looped > 0.0 and extent > 0.0 else 0.0
            at -= rounds * extent
            k, last = first[i], first[i + 1]
            while k + 1 < last and lanes[k + 1, 0] <= at:
                k += 1
            now, before = lanes[k], lanes[max(k - 1, first[i])]
            inside = min(max(at, now[0]), now[1])
            out[0, t, i] = out[1, t, i] = min(
                max((now[2] + (inside - now[0]) * now[3]) / step, 0.0), frames - 1.0
            )
            out[2, t, i] = 0.0
            if k > first[i] and at < before[1]:
                second = before[2] + (at - before[0]) * before[3]
                out[0, t, i] = min(max(second / step, 0.0), frames - 1.0)
                share = (at - now[0]) / (before[1] - now[0])
                out[2, t, i] = share * share * (3.0 - 2.0 * share)
            out[3, t, i] = rounds
            out[4, t, i] = 1.0 if held > 0.0 else _fade_weight(at, rounds, rows[i], now, lanes[last - 1, 1])


@njit(cache=True, nogil=True)
def _fade_weight(at, rounds, row, now, end_of_lane):
    """Returns the fade weight of a layer without ``hold``. It is equal to the weight that ``TimeMap``
    computes."""
    speed, looped, ease = row[1], row[2], row[7]
    begin, end = now[4], now[5]
    if looped > 0.0:
        if (rounds < 0.0 and speed > 0.0) or (rounds > 0.0 and speed < 0.0):
            return 0.0
        if begin <= 1e-9 and (rounds != 0.0 or speed < 0.0):
            begin = -np.inf
        if end >= end_of_lane - 1e-9 and (rounds != 0.0 or speed > 0.0):
            end = np.inf
    if not begin <= at <= end:
        return 0.0
    if ease <= 0.0:
        return 1.0
    share = min((at - begin) / ease, (end - at) / ease, 1.0)
    return share * share * (3.0 - 2.0 * share)
