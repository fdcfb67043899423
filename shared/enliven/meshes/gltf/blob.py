"""The binary chunk of a GLB under construction. It stores arrays, and returns the numbers of their
accessors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pygltflib

from enliven.arrays import AnyArray

_ACCESSOR_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
"""Name of glTF's accessor type by its number of components (glTF 2.0, table 3.6.2.2)."""
_COMPONENT_TYPES: dict[Any, int] = {
    np.dtype(np.uint8): pygltflib.UNSIGNED_BYTE,
    np.dtype(np.uint16): pygltflib.UNSIGNED_SHORT,
    np.dtype(np.uint32): pygltflib.UNSIGNED_INT,
    np.dtype(np.float32): pygltflib.FLOAT,
}


class Blob:
    """Consecutive arrays, each aligned to four bytes, with buffer views and accessors."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []
        self._length = 0
        self.views: list[pygltflib.BufferView] = []
        self.accessors: list[pygltflib.Accessor] = []

    def add(self, array: AnyArray, target: int | None = None, normalised: bool = False) -> int:
        """Adds an array (N, C) or (N,) and returns its accessor's number.

        The size of a row must be a multiple of 4 bytes.

        Args:
            target: glTF's code for the use of the buffer on the GPU (vertices or indices).
            normalised: True for integers that represent 0..1.
        """
        array = np.ascontiguousarray(array)
        rows = array.reshape(len(array), -1)
        data = array.tobytes()
        view = pygltflib.BufferView(buffer=0, byteOffset=self._length, byteLength=len(data), target=target)
        accessor = pygltflib.Accessor(
            bufferView=len(self.views),
            componentType=_COMPONENT_TYPES[array.dtype],
            count=len(rows),
            type=_ACCESSOR_TYPES[rows.shape[1]],
            # The format requires the bounds of the stored float32 numbers, which JSON represents exactly.
            min=rows.min(0).tolist(),
            max=rows.max(0).tolist(),
        )
        if normalised:
            accessor.normalized = True
        self.views.append(view)
        self.accessors.append(accessor)
        padding = -len(data) % 4
        self._pieces.append(data + b"\0" * padding)
        self._length += len(data) + padding
        return len(self.accessors) - 1

    def add_bytes(self, data: AnyArray) -> int:
        """Adds bytes (N,) without an accessor, such as an image, and returns their view's number."""
        self.views.append(pygltflib.BufferView(buffer=0, byteOffset=self._length, byteLength=len(data)))
        padding = -len(data) % 4
        self._pieces.append(data.tobytes() + b"\0" * padding)
        self._length += len(data) + padding
        return len(self.views) - 1

    def bytes(self) -> bytes:
        """Returns the complete binary chunk with all added arrays."""
        return b"".join(self._pieces)
