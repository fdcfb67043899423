"""Checks of the headers of mesh files, before a library reads them.

The library's time grows with the square of some of their numbers, so that one megabyte could take minutes.
"""

from __future__ import annotations

import re

_MOST_PROPERTIES = 256
"""Of a PLY: scanners write some 20."""
_MOST_HEAD = 1 << 16
"""Bytes of the head of a PLY, comments and all."""
_MOST_GROUPS = 4096
"""Changes of material, object or group of an OBJ that are told apart: city models have some hundred."""
_GROUP = re.compile(rb"^[ \t]*(?:usemtl|o|g)[ \t][^\n]*", re.MULTILINE)


def check_ply(data: bytes) -> None:
    """Refuse a PLY with a broken header.

    Raises:
        ValueError: where the head does not end, or states too many properties or a negative count.
    """
    end = data.find(b"end_header", 0, _MOST_HEAD)
    if not data.startswith(b"ply") or end < 0:
        raise ValueError("it has no head of a PLY file")
    lines = [line.split() for line in data[:end].splitlines()]
    count = sum(line[:1] == [b"property"] for line in lines)
    if count > _MOST_PROPERTIES:
        raise ValueError(f"it has {count} properties, and no more than {_MOST_PROPERTIES} are read")
    for line in lines:
        if line[:1] == [b"element"] and (len(line) != 3 or not line[2].isdigit() or int(line[2]) > len(data)):
            said = b" ".join(line).decode("ascii", "replace")[:80]
            raise ValueError(f"its head says {said!r}, and it has {len(data)} bytes")


def check_obj(data: bytes) -> None:
    """Refuse an OBJ of more materials and groups than any model has.

    Raises:
        ValueError: where there are too many.
    """
    groups = set(_GROUP.findall(data))
    if len(groups) > _MOST_GROUPS:
        raise ValueError(f"it has {len(groups)} groups, and no more than {_MOST_GROUPS} are read")
