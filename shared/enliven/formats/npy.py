"""Reads arrays from the bytes of .npy files. Checks first that the size in the header matches the data."""

from __future__ import annotations

import io
import math

import numpy as np

from enliven.arrays import AnyArray

_ACCEPTED_ARRAY_KINDS = "biuf"
"""Accepted array kinds: booleans, integers and floats. Object arrays are refused, because unpickling them
could run code, and their size is not in the header."""


def read_npy(data: bytes) -> AnyArray:
    """Reads the array of an .npy file. Memory is allocated only after the size in the header was compared
    with the data.

    Raises:
        ValueError: if the header is invalid, or its size differs from the number of bytes that follow.
    """
    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    if version not in ((1, 0), (2, 0)):
        raise ValueError(f"the array file has the unsupported version {version}")
    read = np.lib.format.read_array_header_1_0 if version[0] == 1 else np.lib.format.read_array_header_2_0
    try:
        shape, fortran, kind = read(file)
    except Exception:  # The header is a Python literal, and its parser may raise any exception.
        raise ValueError("the header of the array file is damaged") from None
    count = math.prod(shape)
    if kind.kind not in _ACCEPTED_ARRAY_KINDS or kind.names is not None or min(shape, default=0) < 0:
        raise ValueError(f"the array file contains {kind} of shape {shape}, which is not supported")
    if count * kind.itemsize != len(data) - file.tell():
        raise ValueError(
            f"the header of the array file states {count} numbers, but {len(data) - file.tell()} bytes follow"
        )
    flat_values = np.frombuffer(data, kind, count, file.tell())
    return np.array(flat_values.reshape(shape[::-1]).T if fortran else flat_values.reshape(shape))
