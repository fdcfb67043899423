"""Reads arrays from the bytes of an .npy file after checking that the header's size fits the data."""

from __future__ import annotations

import io
import math

import numpy as np

from enliven.arrays import AnyArray

_KINDS = "biuf"
"""NumPy kinds that are read: booleans, integers and floats; an array of objects could run code or hide its
size."""


def array_of(data: bytes) -> AnyArray:
    """Reads the array of an .npy file; no memory is allocated before its size is known to fit the bytes.

    Raises:
        ValueError: where the head is none, or states another number of bytes than there are.
    """
    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    if version not in ((1, 0), (2, 0)):
        raise ValueError(f"it is of version {version}")
    read = np.lib.format.read_array_header_1_0 if version[0] == 1 else np.lib.format.read_array_header_2_0
    try:
        shape, fortran, kind = read(file)
    except Exception:  # the head is Python, and its parser raises whatever it likes
        raise ValueError("its head is damaged") from None
    count = math.prod(shape)
    if kind.kind not in _KINDS or kind.names is not None or min(shape, default=0) < 0:
        raise ValueError(f"it holds {kind} of shape {shape}")
    if count * kind.itemsize != len(data) - file.tell():
        raise ValueError(f"its head states {count} numbers, and {len(data) - file.tell()} bytes follow")
    flat = np.frombuffer(data, kind, count, file.tell())
    return np.array(flat.reshape(shape[::-1]).T if fortran else flat.reshape(shape))
