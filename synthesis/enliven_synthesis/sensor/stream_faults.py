"""What goes wrong between a sensor and its reader: frames that come late, twice, never, or half empty.

Each function takes the frames of a scene in their order and gives them as a reader would get them. With a
frame travels whatever belongs to it (its truth).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from enliven.frames import DepthFrame

T = TypeVar("T")
Seen = tuple[DepthFrame, T]


def dropped(frames: Sequence[Seen[T]], part: float = 0.3, seed: int = 0) -> list[Seen[T]]:
    """The frames without a random part of them, and without a few in a row here and there."""
    random = np.random.default_rng(seed)
    kept = random.random(len(frames)) >= part
    for _ in range(len(frames) // 90):
        start = int(random.integers(len(frames)))
        kept[start : start + 8] = False
    kept[0] = True
    return [pair for pair, keep in zip(frames, kept, strict=True) if keep]


def slowed(frames: Sequence[Seen[T]], fps: float = 5.0) -> list[Seen[T]]:
    """About ``fps`` of the frames a second."""
    out, due = [], -np.inf
    for frame, truth in frames:
        if frame.time_ns >= due:
            out.append((frame, truth))
            due = frame.time_ns + 1e9 / fps - 1e6
    return out


def out_of_order(frames: Sequence[Seen[T]], part: float = 0.15, seed: int = 0) -> list[Seen[T]]:
    """Some frames come one to three places late, with the time at which they were taken."""
    random = np.random.default_rng(seed)
    late = np.where(random.random(len(frames)) < part, random.integers(1, 4, len(frames)), 0)
    order = np.argsort(np.arange(len(frames)) + late + 0.5 * (late > 0), kind="stable")
    return [frames[n] for n in order]


def frozen(frames: Sequence[Seen[T]], start: float, stop: float) -> list[Seen[T]]:
    """From ``start`` to ``stop`` seconds the sensor repeats its last image under new times."""
    out, held = [], frames[0][0]
    first = frames[0][0].time_ns
    for frame, truth in frames:
        if start <= (frame.time_ns - first) * 1e-9 < stop:
            frame = replace(frame, depth=held.depth)
        else:
            held = frame
        out.append((frame, truth))
    return out


def covered(frames: Sequence[Seen[T]], start: float, stop: float) -> list[Seen[T]]:
    """From ``start`` to ``stop`` seconds something covers the lens: no depth at all."""
    first = frames[0][0].time_ns
    return [
        (replace(f, depth=np.zeros_like(f.depth)), truth)
        if start <= (f.time_ns - first) * 1e-9 < stop
        else (f, truth)
        for f, truth in frames
    ]


def holed(frames: Sequence[Seen[T]], part: float = 0.4, seed: int = 0) -> list[Seen[T]]:
    """A part of every image is missing: half of that as single pixels, half as patches."""
    random = np.random.default_rng(seed)
    single = 1.0 - np.sqrt(1.0 - part)
    out = []
    for frame, truth in frames:
        height, width = frame.depth.shape
        coarse = random.random((-(-height // 12), -(-width // 12))) < single
        lost = np.kron(coarse, np.ones((12, 12), bool))[:height, :width]
        lost = lost | (random.random(frame.depth.shape) < single)
        out.append((replace(frame, depth=np.where(lost, 0, frame.depth).astype(np.uint16)), truth))
    return out
