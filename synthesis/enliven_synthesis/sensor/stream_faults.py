"""Simulates faults of a stream: frames that are late, repeated, missing or partly empty.

Each function takes the frames of a scene in order. It returns them as a reader would receive them. Each frame
keeps its ground truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from enliven.frames import DepthFrame

T = TypeVar("T")
FrameAndTruth = tuple[DepthFrame, T]
"""A frame with its ground truth."""


def drop_frames(
    frames: Sequence[FrameAndTruth[T]], part: float = 0.3, seed: int = 0
) -> list[FrameAndTruth[T]]:
    """Drops a random fraction of the frames, and occasionally eight successive frames."""
    random = np.random.default_rng(seed)
    is_kept = random.random(len(frames)) >= part
    for _ in range(len(frames) // 90):
        start = int(random.integers(len(frames)))
        is_kept[start : start + 8] = False
    is_kept[0] = True
    return [pair for pair, keep in zip(frames, is_kept, strict=True) if keep]


def slow_frames(frames: Sequence[FrameAndTruth[T]], fps: float = 5.0) -> list[FrameAndTruth[T]]:
    """Keeps about ``fps`` frames per second."""
    out, next_due_ns = [], -np.inf
    for frame, truth in frames:
        if frame.time_ns >= next_due_ns:
            out.append((frame, truth))
            next_due_ns = frame.time_ns + 1e9 / fps - 1e6
    return out


def reorder_frames(
    frames: Sequence[FrameAndTruth[T]], part: float = 0.15, seed: int = 0
) -> list[FrameAndTruth[T]]:
    """Delays a random fraction of the frames by one to three places in the order. Their timestamps stay the
    same.
    """
    random = np.random.default_rng(seed)
    delay = np.where(random.random(len(frames)) < part, random.integers(1, 4, len(frames)), 0)
    order = np.argsort(np.arange(len(frames)) + delay + 0.5 * (delay > 0), kind="stable")
    return [frames[n] for n in order]


def freeze_frames(frames: Sequence[FrameAndTruth[T]], start: float, stop: float) -> list[FrameAndTruth[T]]:
    """Repeats the last image with new timestamps from ``start`` to ``stop`` seconds."""
    out, frozen_frame = [], frames[0][0]
    first = frames[0][0].time_ns
    for frame, truth in frames:
        if start <= (frame.time_ns - first) * 1e-9 < stop:
            frame = replace(frame, depth=frozen_frame.depth)
        else:
            frozen_frame = frame
        out.append((frame, truth))
    return out


def cover_lens(frames: Sequence[FrameAndTruth[T]], start: float, stop: float) -> list[FrameAndTruth[T]]:
    """Clears all depth from ``start`` to ``stop`` seconds, as if the lens were covered."""
    first = frames[0][0].time_ns
    return [
        (replace(f, depth=np.zeros_like(f.depth)), truth)
        if start <= (f.time_ns - first) * 1e-9 < stop
        else (f, truth)
        for f, truth in frames
    ]


def remove_depth(
    frames: Sequence[FrameAndTruth[T]], part: float = 0.4, seed: int = 0
) -> list[FrameAndTruth[T]]:
    """Clears a fraction of every image. Half of the cleared area is single pixels, the other half is
    patches.
    """
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
