"""Generates unused names."""

from __future__ import annotations

from collections.abc import Container


def unused(stem: str, taken: Container[str], between: str = " ") -> str:
    """Returns ``stem`` if it is unused, or otherwise the first unused name of ``stem 2``, ``stem 3``, ...

    If the stem ends in a number, counting continues from this number, as from "part 2" to "part 3".
    """
    if stem not in taken:
        return stem
    stem_before, _, last = stem.rpartition(between)
    number = int(last) if stem_before and last.isdecimal() else 1
    base_name, name = (stem_before if number > 1 else stem), stem
    while name in taken:
        number += 1
        name = f"{base_name}{between}{number}"
    return name
