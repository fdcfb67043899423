"""The commands that a control may give, and their effects on the stage."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Literal, cast, get_args

from enliven.errors import InputError
from enliven.wire import Browse, Lock, Order, Possess, Release
from enliven_edge.stage import Stage

Word = Literal["possess", "join", "extend", "release", "next", "previous", "follow", "lock", "unlock"]

WORDS: tuple[Word, ...] = get_args(Word)

_STEPS = {"next": 1, "previous": -1, "follow": 0}
"""Places that each command moves on in the ranking of matches; 0 follows the pose again."""
_MODES: dict[str, Literal["alone", "join", "extend"]] = {
    "possess": "alone",
    "join": "join",
    "extend": "extend",
}


def checked_map(given: Mapping[str, str], where: str) -> dict[str, Word]:
    """Returns the map from a control's keys to commands after checking every command.

    Raises:
        InputError: for an unknown word, with the nearest known one.
    """
    for key, word in given.items():
        if word not in WORDS:
            near = difflib.get_close_matches(word, WORDS, n=1)
            mend = f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(WORDS)}."
            raise InputError(f"{key!r} means {word!r}, which is no command", where=where, mend=mend)
    return {key: cast(Word, word) for key, word in given.items()}


def orders(word: Word, stage: Stage) -> list[Order]:
    """Returns the orders that a command means: those of a viewer that names no character."""
    if word in ("lock", "unlock"):
        return [Lock(word == "lock")]
    if not stage.actors:
        return []
    if word == "release":
        return [Release()]
    if word in _STEPS:
        return [Browse(step=_STEPS[word])]
    mode = _MODES[word]
    return [Possess(one.character, one.body, one.parts, mode) for one in stage.takings(mode)]
