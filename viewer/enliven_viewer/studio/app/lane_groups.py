"""Groups layers that share a row (lane) of the timeline, because they play the same take in the same way."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from enliven.document import LayerBase, Project

_MAX_TAKE_LANES = 12
"""Up to this number of layers of one take have a lane each. Models with one layer per bone have more layers,
and these share lanes.
"""


def group_layers(
    project: Project, opened: Collection[str] | None = None
) -> tuple[tuple[str, tuple[int, ...]], ...]:
    """Returns each character with the numbers of the layers that share a lane, from the top.

    Args:
        project: the project with the layers.
        opened: groups of alternative takes that show a lane for every take. Other groups show only the active
            take. None means all groups.
    """
    groups: dict[tuple[object, ...], list[int]] = {}
    for key, character in project.characters.items():
        playing = character.playing
        hidden = set[int]() if opened is None else _find_hidden_layers(playing, opened)
        for number, layer in enumerate(playing):
            if number in hidden:
                continue
            is_small_group = sum(other.take == layer.take for other in playing) <= _MAX_TAKE_LANES
            own_lane = number if is_small_group and layer.source == "takes" else -1
            group_key = (layer.take, layer.muted, layer.list_timing_values())
            groups.setdefault((key, *group_key, own_lane), []).append(number)
    return tuple((str(group[0]), tuple(numbers)) for group, numbers in groups.items())


def find_lane_layers(project: Project, character: str, number: int) -> tuple[int, ...]:
    """Returns the numbers of the layers that share a lane with a layer, from the first to the last."""
    lanes = group_layers(project)
    return next((numbers for name, numbers in lanes if name == character and number in numbers), (number,))


def _find_hidden_layers(playing: Sequence[LayerBase], opened: Collection[str]) -> set[int]:
    """Returns the numbers of the layers without a lane: muted takes in a closed group of alternatives."""
    takes_by_group: dict[str, dict[str, list[int]]] = {}
    for number, layer in enumerate(playing):
        if layer.alternatives and layer.alternatives not in opened:
            takes_by_group.setdefault(layer.alternatives, {}).setdefault(layer.recorded, []).append(number)
    hidden = set[int]()
    for takes in takes_by_group.values():
        audible_names = [
            name for name, layer_numbers in takes.items() if not all(playing[k].muted for k in layer_numbers)
        ]
        shown_name = audible_names[-1] if audible_names else list(takes)[-1]
        hidden.update(k for name, layer_numbers in takes.items() if name != shown_name for k in layer_numbers)
    return hidden
