"""The shapes of a project at a moment, and the length of the project."""

from __future__ import annotations

import math

from enliven.document import Layer, Project, Shape
from enliven.motion.layers import Player
from enliven_viewer.studio.viewport.pose_at_time import PosedShape

_MOST = 4.0
"""Times its length that a project may play longer to end where all loops begin again together."""
_ALMOST = 0.02
"""Share of a round by which loops may miss one another there: too little to be seen as a jump."""


class Players:
    """The players of a project's shapes; a player is kept while its shape and layers stay the same."""

    def __init__(self) -> None:
        self._players: dict[str, tuple[tuple[object, ...], Player]] = {}

    def posed_shapes(self, project: Project, time: float) -> tuple[PosedShape, ...]:
        """Every shape of the project at a time, seconds."""
        self._players = {name: self._player(project, shape) for name, shape in project.shapes.items()}
        return tuple(_posed(player, time) for _, player in self._players.values())

    def _player(self, project: Project, shape: Shape) -> tuple[tuple[object, ...], Player]:
        parts = (shape, *(project.layers[name] for name in layers_of(shape)))
        known = self._players.get(shape.id)
        if (
            known
            and len(known[0]) == len(parts)
            and all(a is b for a, b in zip(known[0], parts, strict=True))
        ):
            return known
        return parts, Player(project, shape.id)


def layers_of(shape: Shape) -> tuple[str, ...]:
    """The ids of the layers that a shape refers to, each once, in the order of its bones."""
    found = dict.fromkeys(ref.layer for spans in shape.spans for span in spans for ref in span.refs)
    if shape.travel:
        found[shape.travel] = None
    return tuple(found)


def used_layers(project: Project) -> tuple[Layer, ...]:
    """The layers that some shape refers to, in the order of the shapes."""
    names = dict.fromkeys(name for shape in project.shapes.values() for name in layers_of(shape))
    return tuple(project.layers[name] for name in names)


def length_of(project: Project, shortest: float) -> float:
    """Seconds that the project plays: until each layer in use was played once, at least ``shortest``.

    With looping layers it is a little longer, where all of them then begin again together.
    """
    layers = used_layers(project)
    least = max([shortest, *(end_of(project, layer) for layer in layers)])
    rounds = [layer.lasting(project.takes[layer.take].duration) for layer in layers if layer.loop]
    rounds = [seconds for seconds in rounds if seconds > 0.05]
    if not rounds:
        return least
    longest = max(rounds)
    for count in range(math.ceil(least / longest - _ALMOST), math.ceil(_MOST * least / longest) + 1):
        length = count * longest
        if all(abs(length / seconds - round(length / seconds)) < _ALMOST for seconds in rounds):
            return length
    return least


def end_of(project: Project, layer: Layer) -> float:
    """The second at which a layer's take has been played once."""
    return layer.end(project.takes[layer.take].duration)


def _posed(player: Player, time: float) -> PosedShape:
    at = player.at(time)
    return PosedShape(player.shape, at.turns, at.joints)
