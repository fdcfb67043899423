"""The shapes of a project at a moment, and the length of the project."""

from __future__ import annotations

import math

from enliven.document import Project, Shape
from enliven.motion.layers import Player
from enliven_viewer.studio.viewport.pose_at_time import PosedShape

_MOST = 4.0
"""Times its length that a project may play longer to end where all loops begin again together."""
_ALMOST = 0.02
"""Share of a round by which loops may miss one another there: too little to be seen as a jump."""


class Players:
    """The players of a project's shapes; a player is kept while its shape stays the same."""

    def __init__(self) -> None:
        self._players: dict[str, tuple[Shape, Player]] = {}

    def posed_shapes(self, project: Project, time: float) -> tuple[PosedShape, ...]:
        """Every shape of the project at a time, seconds."""
        self._players = {name: self._player(project, shape) for name, shape in project.shapes.items()}
        return tuple(_posed(player, time) for _, player in self._players.values())

    def _player(self, project: Project, shape: Shape) -> tuple[Shape, Player]:
        known = self._players.get(shape.id)
        return known if known is not None and known[0] is shape else (shape, Player(project, shape.id))


def length_of(project: Project, shortest: float) -> float:
    """Seconds that the project plays: until each layer was played once, at least ``shortest``.

    With looping layers it is a little longer, where all of them then begin again together.
    """
    layers = [layer for character in project.characters.values() for layer in character.playing]
    least = max([shortest, *(layer.end(project.length_of(layer)) for layer in layers)])
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


def _posed(player: Player, time: float) -> PosedShape:
    at = player.at(time)
    return PosedShape(player.shape, at.turns, at.joints)
