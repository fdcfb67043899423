"""Converts the characters of performances for file formats that store network messages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from enliven.document import Character
from enliven.exporters.performance import Performance
from enliven.wire import MAX_ID_LENGTH


def wire_characters(performances: Sequence[Performance]) -> list[Character]:
    """Returns the characters of performances, with ids that are unique and short enough for network messages.

    Raises:
        InputError: if one has no mesh.
    """
    return [
        replace(performance.character, id=_unique_id(performance.name, number, performances))
        for number, performance in enumerate(performances)
    ]


def _unique_id(name: str, number: int, performances: Sequence[Performance]) -> str:
    """Returns a character's name, shortened to the maximum length of an id. If the name is not unique, its
    number is appended."""
    short_name = name[:MAX_ID_LENGTH] or "character"
    if sum(other.name[:MAX_ID_LENGTH] == short_name for other in performances) < 2:
        return short_name
    suffix = f" {number + 1}"
    return short_name[: MAX_ID_LENGTH - len(suffix)] + suffix
