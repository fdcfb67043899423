"""What the fields of messages may be: types with their ranges, and arrays as bytes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from msgspec import Meta

from enliven.arrays import AnyArray

Name = Annotated[str, Meta(min_length=1, max_length=64)]
Text = Annotated[str, Meta(max_length=400)]
Sentence = Annotated[str, Meta(max_length=160)]
Count = Annotated[int, Meta(ge=0, le=2**53)]
Identity = Annotated[int, Meta(ge=-(2**31), le=2**31 - 1)]
"""Of a performer."""
Nanoseconds = Annotated[int, Meta(ge=-(2**63), le=2**63 - 1)]
Number = Annotated[float, Meta(ge=-1e12, le=1e12)]
"""Finite: msgspec refuses NaN and infinities by the range."""

MAX_TRANSFORM_BYTES = 256 * 1024
MAX_VERTICES = 2_000_000
MAX_FACES = 4_000_000
MAX_TRANSFORMS = 4096
MAX_PROPS = 1024
MAX_HEALTH = 8
"""So many keep a heartbeat below the size that older programs take."""


def expect(name: str, data: bytes, length: int) -> None:
    """Refuse an array whose bytes are not as many as its declared count needs."""
    if len(data) != length:
        raise ValueError(f"{name} has {len(data)} bytes, expected {length}")


def to_bytes(array: AnyArray | Sequence[int], dtype: str) -> bytes:
    """The array's numbers as they go on the wire, such as "<f4"."""
    return np.ascontiguousarray(array, dtype).tobytes()


def from_bytes(data: bytes, dtype: str, columns: int) -> AnyArray:
    """(N, columns) in the machine's own byte order, writable by nobody."""
    array = np.frombuffer(data, dtype).reshape(-1, columns)
    return array.astype(array.dtype.newbyteorder("="), copy=False)
