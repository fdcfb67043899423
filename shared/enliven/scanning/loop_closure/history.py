"""Compressed storage of a scan's images, so that they can be fused again at better poses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from enliven.frames import DepthFrame
from enliven.recording import pack_depth, unpack_depth

MAX_HISTORY_MB = 400
"""Maximum memory in megabytes for compressed images, which are fused again after a loop closure."""
_COLOUR_INTERVAL = 4
"""Colours are stored only for every fourth image, because they change slowly, and take ten times as much
memory as the depth."""


@dataclass(frozen=True)
class _StoredFrame:
    number: int
    packed: bytes


class FrameHistory:
    """Compressed depth images by number, some with colours. When they exceed the memory limit, every second
    image is dropped.

    Args:
        megabytes: memory limit.
    """

    def __init__(self, megabytes: float) -> None:
        self._most, self._held = megabytes * 1e6, 0
        self._kept: list[_StoredFrame] = []
        self._every = 1

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def megabytes(self) -> float:
        """Memory of the compressed images, in megabytes."""
        return self._held * 1e-6

    @property
    def numbers(self) -> list[int]:
        """The numbers of the images that are still stored."""
        return [stored.number for stored in self._kept]

    def add(self, number: int, frame: DepthFrame) -> None:
        """Stores an image. Its number must be larger than all earlier numbers."""
        if number % self._every:
            return
        painted = number // self._every % _COLOUR_INTERVAL == 0
        packed = pack_depth(frame if painted else replace(frame, colour=None), 1)
        self._kept.append(_StoredFrame(number, packed))
        self._held += len(packed)
        while self._held > self._most and len(self._kept) > 1:
            self._every *= 2
            self._kept = [stored for stored in self._kept if stored.number % self._every == 0]
            self._held = sum(len(stored.packed) for stored in self._kept)

    def frames(self, numbers: list[int] | None = None) -> Iterator[tuple[int, DepthFrame]]:
        """Yields pairs of number and image, for the stored images with the given numbers, or for all stored
        images."""
        requested = None if numbers is None else set(numbers)
        for stored in self._kept:
            if requested is None or stored.number in requested:
                yield stored.number, unpack_depth(stored.packed)
