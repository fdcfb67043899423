"""Names that are not taken yet."""

from __future__ import annotations

from collections.abc import Container


def unused(stem: str, taken: Container[str], between: str = " ") -> str:
    """``stem``, or ``stem 2``, ``stem 3``, ...: the first that is not taken."""
    number, name = 1, stem
    while name in taken:
        number += 1
        name = f"{stem}{between}{number}"
    return name
