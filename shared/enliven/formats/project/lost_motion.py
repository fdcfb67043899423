"""Replaces missing or damaged motion in a project file by the rest pose, if the motion can be solved again
from recorded performers.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from enliven.arrays import AnyArray
from enliven.document import GraphCharacter
from enliven.formats.project.values import ARRAY, KIND, array_checksum


def replace_lost_motion(project: Any, arrays: dict[str, AnyArray]) -> tuple[Any, set[str]]:
    """Replaces each lost stream that can be solved again by a stream at rest. Its part is marked as not
    solved.

    Args:
        arrays: the readable arrays by name. The function adds the arrays of the streams at rest.

    Returns:
        The project object, and the names of the arrays of the lost streams.
    """
    streams, characters = (
        _read_table_or_empty(_read_table_or_empty(project).get("streams")),
        _read_table_or_empty(_read_table_or_empty(project).get("characters")),
    )
    mended_streams = dict(streams)
    mended_characters = dict(characters)
    for key, character in characters.items():
        parts = _read_table_or_empty(character).get("parts")
        if _read_table_or_empty(character).get(KIND) == GraphCharacter.kind and isinstance(parts, list):
            mended = [_replace_lost_stream(part, streams, mended_streams, arrays) for part in parts]
            mended_characters[key] = {**character, "parts": mended}
    lost = {
        str(_read_table_or_empty(streams.get(name, {}).get(field)).get(ARRAY))
        for name, stream in mended_streams.items()
        if stream is not streams.get(name)
        for field in ("linear", "positions")
    }
    return (
        ({**project, "streams": mended_streams, "characters": mended_characters}, lost)
        if lost
        else (project, lost)
    )


def _replace_lost_stream(
    part: Any, streams: dict[str, Any], found: dict[str, Any], arrays: dict[str, AnyArray]
) -> Any:
    """Returns a part. If its stream is lost, adds a stream at rest to ``found``, and marks the returned part
    as not solved.
    """
    possession, name = (
        _read_table_or_empty(_read_table_or_empty(part).get("possession")),
        _read_table_or_empty(part).get("take"),
    )
    rest = arrays.get(str(_read_table_or_empty(possession.get("rest")).get(ARRAY)))
    stream = _read_table_or_empty(streams.get(str(name)))
    is_complete = all(
        _read_table_or_empty(stream.get(field)).get(ARRAY) in arrays for field in ("linear", "positions")
    )
    if is_complete or not isinstance(name, str) or rest is None or rest.ndim != 2 or rest.shape[1:] != (3,):
        return part
    table: dict[str, Any] = {"id": name, "step": stream.get("step", 1.0)}
    at_rest = np.array(rest[None], np.float64)
    for field, array in (("linear", np.tile(np.eye(3), (1, len(rest), 1, 1))), ("positions", at_rest)):
        table[field] = {ARRAY: array_checksum(array)}
        arrays[array_checksum(array)] = array
    found[name] = table
    return {**part, "possession": {**possession, "solved": ""}}


def _read_table_or_empty(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}
