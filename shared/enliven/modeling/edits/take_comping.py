"""Alternative takes (take comping): a project keeps several performances of the same motion, and one of them
plays.

    list_alternative_takes(project, "take 1")      # {"take 1": False, "take 2": True}: the second plays
    choose_take(project, "take 1", "take 1")       # the first plays again, for every character
    drop_take(project, "take 1", "take 2")         # removes its layers and its takes

Each layer stores the name of its recording and the name of the recording's group of alternatives. Cuts,
merges and copies keep both names. Each edit maps a project to a project. An invalid edit raises InputError
and changes nothing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from enliven.document import GraphPart, LayerBase, PoseStream, Project, RigBase, unused
from enliven.errors import InputError


def list_alternative_takes(project: Project, alternatives: str) -> dict[str, bool]:
    """Returns the recordings in a group of alternatives, in their order, each with True if it plays."""
    is_playing: dict[str, bool] = {}
    for character in project.characters.values():
        for layer in character.playing:
            if alternatives and layer.alternatives == alternatives:
                is_playing[layer.recorded] = is_playing.get(layer.recorded, False) or not layer.muted
    return is_playing


def find_alternatives(project: Project, recorded: str) -> str:
    """Returns the name of the group of alternatives that contains a recording, or "" if no layer of the
    recording is left."""
    layers = (layer for character in project.characters.values() for layer in character.playing)
    return next((layer.alternatives for layer in layers if recorded and layer.recorded == recorded), "")


def choose_take(project: Project, alternatives: str, recorded: str) -> Project:
    """Selects the alternative that plays, for every character. An empty name mutes all alternatives.

    Raises:
        InputError: if the recording is not in the group.
    """
    takes = list_alternative_takes(project, alternatives)
    if recorded and recorded not in takes:
        remedy = f"Recordings in this group: {', '.join(takes) or 'none'}."
        raise InputError(
            f"the recording {recorded!r} is not in this group of alternative takes",
            where=f"takes {alternatives!r}",
            remedy=remedy,
        )

    def heard(layer: LayerBase) -> LayerBase:
        if layer.alternatives != alternatives:
            return layer
        changes: dict[str, Any] = {"muted": layer.recorded != recorded}
        return replace(layer, **changes)

    changed = [
        character.with_playing(*map(heard, character.playing))
        for character in project.characters.values()
        if any(layer.alternatives == alternatives for layer in character.playing)
    ]
    return project.with_characters(*changed) if alternatives else project


def group_as_take(old_project: Project, project: Project, recorded: str, alternatives: str) -> Project:
    """Adds the layers with new takes (which ``old_project`` does not contain) to a group of alternatives."""

    def labelled(layer: LayerBase) -> LayerBase:
        takes, earlier_takes = (getattr(take, layer.source) for take in (project, old_project))
        if takes[layer.take] is earlier_takes.get(layer.take):
            return layer
        changes: dict[str, Any] = {"recorded": recorded, "alternatives": alternatives}
        return replace(layer, **changes)

    changed = [
        character.with_playing(*map(labelled, character.playing))
        for name, character in project.characters.items()
        if character is not old_project.characters.get(name)
    ]
    project = project.with_characters(*changed)
    is_listed = recorded in list_alternative_takes(project, alternatives)
    return choose_take(project, alternatives, recorded) if is_listed else project


def drop_take(project: Project, alternatives: str, recorded: str) -> Project:
    """Removes one of several alternatives: its layers, and takes that are no longer played.

    The first recording of a possessed mesh moves its nodes. If it is removed, the nodes keep the pose of its
    first frame. If the removed alternative was playing, the previous alternative plays next, or the following
    alternative if no previous alternative exists.

    Raises:
        InputError: if the recording is not in the group.
    """
    takes = list_alternative_takes(project, alternatives)
    if recorded not in takes:
        remedy = f"Recordings in this group: {', '.join(takes) or 'none'}."
        raise InputError(
            f"the recording {recorded!r} is not in this group of alternative takes",
            where=f"takes {alternatives!r}",
            remedy=remedy,
        )
    old_project = project
    for character in list(project.characters.values()):
        if any(_plays_recording(layer, alternatives, recorded) for layer in character.playing):
            project = _remove_recording(project, character, alternatives, recorded)
    names = list(takes)
    remaining = [name for name in names if name != recorded]
    if takes[recorded] and remaining:
        position = names.index(recorded)
        project = choose_take(project, alternatives, remaining[max(position - 1, 0)])
    return _remove_unneeded_takes(old_project, project)


def keep_take(project: Project, alternatives: str, recorded: str) -> Project:
    """Keeps one of the alternatives, and removes the others.

    Raises:
        InputError: if the recording is not in the group.
    """
    project = choose_take(project, alternatives, recorded)
    for name in list_alternative_takes(project, alternatives):
        if name != recorded:
            project = drop_take(project, alternatives, name)
    return choose_take(project, alternatives, recorded)


def _plays_recording(layer: LayerBase, alternatives: str, recorded: str) -> bool:
    return layer.alternatives == alternatives and layer.recorded == recorded


def _remove_recording(project: Project, character: RigBase, alternatives: str, recorded: str) -> Project:
    """Removes the layers of a recording from a character."""
    for number in reversed(range(len(character.playing))):
        layer = character.playing[number]
        if not _plays_recording(layer, alternatives, recorded):
            continue
        if isinstance(layer, GraphPart):
            held_part, stream = _hold_first_frame(project, layer)
            character = character.with_playing(
                *character.playing[:number], held_part, *character.playing[number + 1 :]
            )
            project = project.with_streams(stream)
        else:
            character = character.without_layer(number)
    return project.with_characters(character)


def _hold_first_frame(project: Project, part: GraphPart) -> tuple[GraphPart, PoseStream]:
    """Returns a part that keeps the pose of its stream's first frame, and a stream with only that frame."""
    stream = project.streams[part.take]
    name = unused(f"{part.take} still", project.streams)
    first = PoseStream(name, stream.linear[:1], stream.positions[:1], stream.step)
    changes = {"muted": False, "possession": None, "recorded": "", "alternatives": "", "segments": ()}
    return replace(part.with_default_timing(), take=name, **changes), first  # type: ignore[arg-type]


def _remove_unneeded_takes(old_project: Project, project: Project) -> Project:
    """Removes takes that a character of ``old_project`` needed, and that no character of ``project``
    needs."""

    def needed(a_project: Project, kind: str) -> set[str]:
        return set().union(
            *(character.find_needed_ids()[kind] for character in a_project.characters.values())
        )

    changes: dict[str, Any] = {}
    for kind in ("takes", "streams", "bodies"):
        unneeded = needed(old_project, kind) - needed(project, kind)
        takes = getattr(project, kind)
        if unneeded & set(takes):
            changes[kind] = {name: take for name, take in takes.items() if name not in unneeded}
    return replace(project, **changes) if changes else project
