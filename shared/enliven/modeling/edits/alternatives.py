"""Takes of which one is heard: what was performed again is kept beside what was performed before.

    takes_beside(project, "take 1")                # {"take 1": False, "take 2": True}: the second is heard
    choose_take(project, "take 1", "take 1")       # the first is heard again, on every character
    drop_take(project, "take 1", "take 2")         # its layers and its takes are gone

Each layer says which recording it came from, and of which alternatives that is one; so both go along through
cuts, merges and copies. Project -> Project; an edit that is refused raises InputError and changes nothing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from enliven.document import GraphPart, Playing, PoseStream, Project, RigBase, unused
from enliven.errors import InputError


def takes_beside(project: Project, alternatives: str) -> dict[str, bool]:
    """The recordings that are alternatives of one another, in their order, and whether each is heard."""
    found: dict[str, bool] = {}
    for one in project.characters.values():
        for layer in one.playing:
            if alternatives and layer.alternatives == alternatives:
                found[layer.recorded] = found.get(layer.recorded, False) or not layer.muted
    return found


def alternatives_of(project: Project, recorded: str) -> str:
    """The name of the alternatives to which a recording belongs; empty where nothing of it is left."""
    layers = (layer for one in project.characters.values() for layer in one.playing)
    return next((one.alternatives for one in layers if recorded and one.recorded == recorded), "")


def choose_take(project: Project, alternatives: str, recorded: str) -> Project:
    """A project in which one of the alternatives is heard, on every character; none for an empty name.

    Raises:
        InputError: where that is none of them.
    """
    known = takes_beside(project, alternatives)
    if recorded and recorded not in known:
        mend = f"Known: {', '.join(known) or 'none'}."
        raise InputError(f"{recorded!r} is no take there", where=f"takes {alternatives!r}", mend=mend)

    def heard(layer: Playing) -> Playing:
        if layer.alternatives != alternatives:
            return layer
        changes: dict[str, Any] = {"muted": layer.recorded != recorded}
        return replace(layer, **changes)

    changed = [
        one.with_playing(*map(heard, one.playing))
        for one in project.characters.values()
        if any(layer.alternatives == alternatives for layer in one.playing)
    ]
    return project.with_characters(*changed) if alternatives else project


def as_take(before: Project, project: Project, recorded: str, alternatives: str) -> Project:
    """A project in which the layers of takes that ``before`` lacks are one of the alternatives."""

    def told(layer: Playing) -> Playing:
        held, known = (getattr(each, layer.source) for each in (project, before))
        if held[layer.take] is known.get(layer.take):
            return layer
        changes: dict[str, Any] = {"recorded": recorded, "alternatives": alternatives}
        return replace(layer, **changes)

    changed = [
        one.with_playing(*map(told, one.playing))
        for name, one in project.characters.items()
        if one is not before.characters.get(name)
    ]
    project = project.with_characters(*changed)
    made = recorded in takes_beside(project, alternatives)
    return choose_take(project, alternatives, recorded) if made else project


def drop_take(project: Project, alternatives: str, recorded: str) -> Project:
    """A project without one of several alternatives: its layers go, and the takes that nothing plays then.

    The first recording of a possessed mesh is what its nodes play: it stands still there instead. Where the
    one that was heard goes, the one before it is heard, or the next.

    Raises:
        InputError: where that is none of them.
    """
    known = takes_beside(project, alternatives)
    if recorded not in known:
        mend = f"Known: {', '.join(known) or 'none'}."
        raise InputError(f"{recorded!r} is no take there", where=f"takes {alternatives!r}", mend=mend)
    before = project
    for one in list(project.characters.values()):
        if any(_is(layer, alternatives, recorded) for layer in one.playing):
            project = _without(project, one, alternatives, recorded)
    names = list(known)
    left = [name for name in names if name != recorded]
    if known[recorded] and left:
        place = names.index(recorded)
        project = choose_take(project, alternatives, left[max(place - 1, 0)])
    return _tidied(before, project)


def keep_take(project: Project, alternatives: str, recorded: str) -> Project:
    """A project with one of the alternatives alone.

    Raises:
        InputError: where that is none of them.
    """
    project = choose_take(project, alternatives, recorded)
    for name in takes_beside(project, alternatives):
        if name != recorded:
            project = drop_take(project, alternatives, name)
    return choose_take(project, alternatives, recorded)


def _is(layer: Playing, alternatives: str, recorded: str) -> bool:
    return layer.alternatives == alternatives and layer.recorded == recorded


def _without(project: Project, one: RigBase, alternatives: str, recorded: str) -> Project:
    """A project with a character without the layers of a recording."""
    for number in reversed(range(len(one.playing))):
        layer = one.playing[number]
        if not _is(layer, alternatives, recorded):
            continue
        if isinstance(layer, GraphPart):
            still, stream = _still(project, layer)
            one = one.with_playing(*one.playing[:number], still, *one.playing[number + 1 :])
            project = project.with_streams(stream)
        else:
            one = one.without_layer(number)
    return project.with_characters(one)


def _still(project: Project, part: GraphPart) -> tuple[GraphPart, PoseStream]:
    """A part that stands as at its stream's first frame, and the stream of that."""
    stream = project.streams[part.take]
    name = unused(f"{part.take} still", project.streams)
    first = PoseStream(name, stream.linear[:1], stream.positions[:1], stream.step)
    how = {"muted": False, "possession": None, "recorded": "", "alternatives": "", "segments": ()}
    return replace(part.timeless(), take=name, **how), first  # type: ignore[arg-type]


def _tidied(before: Project, project: Project) -> Project:
    """A project without the takes that a character of ``before`` needed and none does now."""

    def needed(one: Project, kind: str) -> set[str]:
        return set().union(*(character.needed()[kind] for character in one.characters.values()))

    changes: dict[str, Any] = {}
    for kind in ("takes", "streams", "bodies"):
        gone = needed(before, kind) - needed(project, kind)
        held = getattr(project, kind)
        if gone & set(held):
            changes[kind] = {name: take for name, take in held.items() if name not in gone}
    return replace(project, **changes) if changes else project
