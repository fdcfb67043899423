"""The length of a project."""

from __future__ import annotations

import math

from enliven.document import Project

_MOST = 4.0
"""Times its length that a project may play longer to end where all loops begin again together."""
_ALMOST = 0.02
"""Share of a round by which loops may miss one another there: too little to be seen as a jump."""


def length_of(project: Project, shortest: float) -> float:
    """Seconds that the project plays: until each layer and sound was played once, at least ``shortest``.

    With looping layers it is a little longer, where all of them then begin again together.
    """
    layers = [layer for character in project.characters.values() for layer in character.playing]
    sounds = [one.end for one in project.sounds.values()]
    least = max([shortest, *(layer.end(project.length_of(layer)) for layer in layers), *sounds])
    rounds = [layer.lasting(project.length_of(layer)) for layer in layers if layer.loop]
    rounds = [seconds for seconds in rounds if seconds > 0.05]
    if not rounds:
        return least
    longest = max(rounds)
    for count in range(math.ceil(least / longest - _ALMOST), math.ceil(_MOST * least / longest) + 1):
        length = count * longest
        if all(abs(length / seconds - round(length / seconds)) < _ALMOST for seconds in rounds):
            return length
    return least
