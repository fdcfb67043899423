"""Depth images in memory that two processes share. The operating system frees the memory when both processes
have ended, even if they crash.

On POSIX the memory is an unnamed file, and the second process inherits its descriptor. On Windows it is a
named mapping that exists while a process has it open.
"""

from __future__ import annotations

import mmap
import os
import secrets
import struct
import sys
import tempfile
from dataclasses import dataclass

import numpy as np

from enliven.camera import Intrinsics
from enliven.frames import DepthFrame
from enliven.supervision.closeable import Closeable

DEPTH_INTERVAL_NS = 100_000_000
"""Minimum interval between two depth images, in nanoseconds of the sensor's clock. It limits the data rate to
6 MB/s at 640x480."""
_SLOTS = 3
"""Number of images in memory. A reader can copy an image until two later images have been written."""
_MAX_IMAGE_BYTES = 8 << 20
"""Maximum size of an image in bytes: 2048 x 2048 pixels. Memory that is never written takes no space."""
_NUMBER = struct.Struct("<Q")
_SLOT_BYTES = _MAX_IMAGE_BYTES + mmap.ALLOCATIONGRANULARITY
"""Size of a slot in bytes. The first page contains the number of the image, and the image begins at the next
page."""


@dataclass(frozen=True)
class DepthReference:
    """A reference to an image in shared memory.

    Attributes:
        number: sequence number of the image, from 1. It also determines the slot.
        intrinsics, time_ns, sensor: the attributes of the :class:`DepthFrame` with these names.
    """

    number: int
    intrinsics: Intrinsics
    time_ns: int
    sensor: str


class DepthMemory(Closeable):
    """Shared memory for the newest depth images, with one writer and one reader.

    Args:
        handle: descriptor or name of existing memory. If None, new memory is created.

    Raises:
        OSError: if the system cannot provide the memory.
    """

    def __init__(self, handle: int | str | None = None) -> None:
        size, self._descriptor = _SLOTS * _SLOT_BYTES, -1
        if sys.platform == "win32":
            self.handle: int | str = (
                f"enliven-{os.getpid()}-{secrets.token_hex(8)}" if handle is None else handle
            )
            self._memory = mmap.mmap(-1, size, tagname=str(self.handle))
        else:
            self._descriptor = _create_file(size) if handle is None else int(handle)
            self.handle = self._descriptor
            self._memory = mmap.mmap(self._descriptor, size)
        self._count = 0

    def write(self, frame: DepthFrame) -> DepthReference | None:
        """Copies an image into the oldest slot. Returns None if it is too large."""
        size = frame.depth.nbytes
        if size > _MAX_IMAGE_BYTES:
            return None
        self._count += 1
        start = self._start(self._count)
        _NUMBER.pack_into(self._memory, start, 0)
        place = np.frombuffer(self._memory, np.uint16, frame.depth.size, start + mmap.ALLOCATIONGRANULARITY)
        place.reshape(frame.depth.shape)[:] = frame.depth
        _NUMBER.pack_into(self._memory, start, self._count)
        return DepthReference(self._count, frame.intrinsics, frame.time_ns, frame.sensor)

    def read(self, reference: DepthReference) -> DepthFrame | None:
        """Returns a copy of an image, or None if a later image has overwritten it."""
        start, camera = self._start(reference.number), reference.intrinsics
        count = camera.width * camera.height
        place = np.frombuffer(self._memory, np.uint16, count, start + mmap.ALLOCATIONGRANULARITY)
        depth = place.reshape(camera.height, camera.width).copy()
        # A writer changes the number before it overwrites the image.
        if _NUMBER.unpack_from(self._memory, start)[0] != reference.number:
            return None
        return DepthFrame(depth, camera, reference.time_ns, reference.sensor)

    def close(self) -> None:
        """Unmaps the memory and closes its descriptor. The other process can still use its own mapping."""
        self._memory.close()
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    @staticmethod
    def _start(number: int) -> int:
        """Returns the offset, in bytes, of the slot of an image."""
        return number % _SLOTS * _SLOT_BYTES


def _create_file(size: int) -> int:
    """Returns the descriptor of an unnamed file. Its content is in memory if the system supports that,
    otherwise on disk."""
    if sys.platform == "linux":
        descriptor = os.memfd_create("enliven depth images")
    else:
        with tempfile.TemporaryFile() as file:
            descriptor = os.dup(file.fileno())
    os.ftruncate(descriptor, size)
    return descriptor
