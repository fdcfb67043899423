"""Images in shared memory: one process writes them, another reads them in place.

The writer fills a slot. The slot is free again when the reader's last array over its memory is deleted.
"""

from __future__ import annotations

import contextlib
import weakref
from multiprocessing.shared_memory import SharedMemory

import numpy as np

from enliven.arrays import UInt8, UInt16

SLOTS = 8
"""Number of images in memory: one is being written, two are queued, and the others are for readers that keep
some."""
MAX_SLOTS = 64
"""Maximum number of images in memory if no frame may be dropped. They cover two seconds, in which a slow disk
catches up."""
_MAX_SLOTS_BYTES = 32 << 20
"""Maximum bytes of all images. :data:`SLOTS` images are allowed even if they need more. Containers often have
64 MiB of shared memory for all programs."""
MIN_FREE_SLOTS = 3
"""Number of slots that stay free for the writer. If fewer are left, the reader copies its image and releases
the slot."""
_HEADER_BYTES = 64
"""Bytes before the first slot, one flag for each of :data:`MAX_SLOTS`. Images start at a cache line."""


def slots_for_all(size: int) -> int:
    """Returns the number of slots for images of ``size`` bytes if no frame may be dropped."""
    return min(max(_MAX_SLOTS_BYTES // size, SLOTS), MAX_SLOTS)


class FrameSlots:
    """A block of shared memory for several images, each a depth image and an optional colour image.

    Args:
        memory: the block, from :meth:`make` or :meth:`attach`.
        size: bytes of a slot.
        count: number of slots.
    """

    def __init__(self, memory: SharedMemory, size: int, count: int) -> None:
        self._memory, self.size, self.count = memory, size, count
        self._taken = np.ndarray((count,), np.uint8, buffer=memory.buf)

    @classmethod
    def make(cls, size: int, count: int = SLOTS) -> FrameSlots:
        """Creates a block for the reader. Call :meth:`forget` as soon as the writer has attached to it."""
        return cls(_Memory(create=True, size=_HEADER_BYTES + count * size), size, count)

    @classmethod
    def attach(cls, name: str, size: int, count: int = SLOTS) -> FrameSlots:
        """Attaches to the existing block called ``name``."""
        return cls(_Memory(name), size, count)

    @property
    def name(self) -> str:
        """Returns the name of the block. The writer attaches with this name."""
        return self._memory.name

    @property
    def free(self) -> int:
        """Returns the number of free slots."""
        return self.count - int(self._taken.sum())

    def forget(self) -> None:
        """Removes the name of the block.

        The system then frees the memory when both processes have ended for any reason.
        """
        with contextlib.suppress(OSError):
            self._memory.unlink()

    def write(self, depth: UInt16, colour: UInt8 | None) -> int | None:
        """Copies an image into a free slot. Returns its number, or None if all are in use."""
        free = np.flatnonzero(self._taken == 0)
        if not len(free):
            return None
        slot = int(free[0])
        place = self._place(slot)
        place[: depth.nbytes].view(np.uint16).reshape(depth.shape)[:] = depth
        if colour is not None:
            place[depth.nbytes : depth.nbytes + colour.nbytes].reshape(colour.shape)[:] = colour
        self._taken[slot] = 1
        return slot

    def read(
        self, slot: int, shape: tuple[int, int], colour: tuple[int, ...] | None
    ) -> tuple[UInt16, UInt8 | None]:
        """Returns the depth and the colour image of a slot, read-only. They are not copied if enough slots
        are free.
        """
        place = self._place(slot)
        if self.free < MIN_FREE_SLOTS:
            place = place.copy()
            self.release(slot)
        else:
            weakref.finalize(place, self.release, slot).atexit = False  # pyrefly: ignore[missing-attribute]
        place.flags.writeable = False
        end = 2 * shape[0] * shape[1]
        seen = None if colour is None else place[end : end + int(np.prod(colour))].reshape(colour)
        return place[:end].view(np.uint16).reshape(shape), seen

    def release(self, slot: int) -> None:
        """Frees a slot for the writer."""
        self._taken[slot] = 0

    def _place(self, slot: int) -> UInt8:
        """Returns the bytes (size,) of a slot, as a separate array."""
        return np.ndarray(
            (self.size,), np.uint8, buffer=self._memory.buf, offset=_HEADER_BYTES + slot * self.size
        )


class _Memory(SharedMemory):
    """Shared memory that may be deleted while arrays over it exist.

    The system unmaps it when the process ends.
    """

    def __del__(self) -> None:
        with contextlib.suppress(BufferError):
            super().__del__()
