"""Reader of STL, binary or ASCII: triangles that share nothing."""

from __future__ import annotations

import re

import numpy as np

from enliven.arrays import Float, Int32

_HEAD = 84
"""Bytes before the first triangle of a binary file: 80 of anything and the count, uint32."""
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def read_stl(data: bytes) -> tuple[Float, Int32]:
    """(3F, 3) corners and (F, 3) triangles of an STL file.

    Raises:
        ValueError: where the file is not as long as its header says, or is neither binary nor ASCII.
    """
    said = int.from_bytes(data[80:_HEAD], "little") if len(data) >= _HEAD else 0
    expected = _HEAD + said * _TRIANGLE.itemsize
    if len(data) >= _HEAD and len(data) == expected:
        corners = np.frombuffer(data, _TRIANGLE, said, _HEAD)["corners"].reshape(-1, 3).astype(np.float64)
    elif data[:_HEAD].lstrip().lower().startswith(b"solid") and _VERTEX.search(data):
        corners = _ascii(data)
    elif len(data) < _HEAD:
        raise ValueError(f"it has {len(data)} bytes, and its header alone has {_HEAD}")
    else:
        raise ValueError(f"its header says {said} triangles, which are {expected} bytes; it has {len(data)}")
    return corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3)


def _ascii(data: bytes) -> Float:
    """(3F, 3) what follows the word "vertex"."""
    if b"endsolid" not in data[-1024:].lower():
        raise ValueError("it ends early: the last line is not endsolid")
    corners = np.array(_VERTEX.findall(data), dtype=np.bytes_).astype(np.float64)
    if len(corners) % 3:
        raise ValueError(f"it has {len(corners)} corners, which are no whole triangles")
    return corners
