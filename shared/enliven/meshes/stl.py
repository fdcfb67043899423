"""Reader of STL files (binary and ASCII), which contain triangles without shared vertices."""

from __future__ import annotations

import re

import numpy as np

from enliven.arrays import Float, Int32
from enliven.files import text_bytes
from enliven.meshes.tokens import DamagedMeshError, parse_numbers, split_into_blocks

_BINARY_HEADER_BYTES = 84
"""Offset of the first triangle in a binary file, in bytes: 80 arbitrary bytes and the count, uint32."""
_TRIANGLE_DTYPE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_SEARCHED_BYTES = 4096
"""Number of bytes at the beginning and at the end of a file that are searched for the keywords of an ASCII
file."""
_VERTEX_LINE = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def read_stl(data: bytes) -> tuple[Float, Int32, list[str]]:
    """Reads an STL file. Returns (3F, 3) corners, (F, 3) triangles, and notes on unusual content.

    Raises:
        DamagedMeshError: if the file is shorter than its header declares, or is neither binary nor ASCII.
    """
    triangle_count = (
        int.from_bytes(data[80:_BINARY_HEADER_BYTES], "little") if len(data) >= _BINARY_HEADER_BYTES else 0
    )
    expected = _BINARY_HEADER_BYTES + triangle_count * _TRIANGLE_DTYPE.itemsize
    text = None if len(data) == expected else _read_ascii_text(data)
    notes = list[str]()
    if text is not None:
        corners = _read_ascii(text)
    elif len(data) < _BINARY_HEADER_BYTES:
        raise DamagedMeshError(
            f"the file has {len(data)} bytes, but the header alone needs {_BINARY_HEADER_BYTES}"
        )
    elif len(data) < expected or triangle_count == 0:
        raise DamagedMeshError(
            f"the header declares {triangle_count} triangles, which need {expected} bytes, but the "
            f"file has {len(data)} bytes"
        )
    else:
        corners = (
            np.frombuffer(data, _TRIANGLE_DTYPE, triangle_count, _BINARY_HEADER_BYTES)["corners"]
            .reshape(-1, 3)
            .astype(np.float64)
        )
        if len(data) > expected:
            notes.append(f"{len(data) - expected} bytes after the last triangle of the file were ignored")
    return corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3), notes


def _read_ascii_text(data: bytes) -> bytes | None:
    """Returns the text of an ASCII file, or None for a binary file. Checks more than the first word, because
    a binary file may also start with "solid"."""
    text = text_bytes(data) if data[:2] in (b"\xff\xfe", b"\xfe\xff") else data.removeprefix(b"\xef\xbb\xbf")
    head = text[:_SEARCHED_BYTES].lstrip()
    return text if head[:5].lower() == b"solid" and _VERTEX_LINE.search(text) else None


def _read_ascii(text: bytes) -> Float:
    """Reads an ASCII file. Returns the coordinates (3F, 3) after each word "vertex"."""
    parts = [_parse_corners(_VERTEX_LINE.findall(block)) for _, block in split_into_blocks(text, b"endloop")]
    corners = np.concatenate([part for part in parts if len(part)])
    last = max(
        text.rfind(b"endsolid"), text.rfind(b"ENDSOLID"), text.lower().rfind(b"endsolid", -_SEARCHED_BYTES)
    )
    if last < max(text.rfind(b"vertex"), text.rfind(b"VERTEX")):
        raise DamagedMeshError("the file ends early: the last line is not endsolid")
    if len(corners) % 3:
        raise DamagedMeshError(
            f"the file has {len(corners)} triangle corners, which is not a multiple of three"
        )
    return corners


def _parse_corners(words: list[tuple[bytes, bytes, bytes]]) -> Float:
    """Parses the words of N corners to coordinates (N, 3)."""
    return parse_numbers(b" ".join(word for corner in words for word in corner)).reshape(-1, 3)
