"""Two characters made one at a moment, of one rig or of two."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import GraphShape, Project, RigBase, unused
from enliven.errors import InputError
from enliven.modeling.edits.rigs import RIGS, handle_number, rig_of
from enliven.modeling.edits.rooted import set_down, taken_up
from enliven.modeling.mesh import SeamSettings
from enliven.modeling.rig import Merge

_SEAM = SeamSettings()
_LONGEST = 20.0
"""Seconds after the merge for which loops of unlike lengths, or over the ground, are recorded."""
_SAME = 1e-6
"""Metres within which a loop ends where it began: rounding."""


def merge_characters(
    project: Project,
    host_id: str,
    graft_id: str,
    time: float,
    *,
    node: int | str | None = None,
    at: float = 1.0,
    loose: bool = False,
    seam: SeamSettings = _SEAM,
    notes: list[str] | None = None,
) -> Project:
    """A project with one character put onto another where the two are at ``time``; they are one from then on.

    At ``time`` both stay where they are, and both go on moving; the graft rides on the host. So keys that
    move the whole host move both from then on, and those of the graft are left out.

    Two of one rig stay of that rig. Of two rigs the result is a deformation graph, in which each side is a
    part with a time of its own. A graph is kept as it is; the bones of a skeleton become its nodes, exact at
    60 frames a second and at ``time``; a puppet is baked, with an error that ``notes`` say. What is recorded
    like that has no joints to pose and no key poses any more (undo brings them back). It plays until each
    take was played once; a loop goes on for ever where it ends as it began, and else for 20 seconds.

    Args:
        node, at, loose, seam, notes: as :class:`enliven.modeling.rig.Merge` has them.

    Raises:
        InputError: for a character merged with itself, a node that is not there, or meshes without a union.
    """
    host, graft = project.character(host_id), project.character(graft_id)
    if host_id == graft_id:
        mend = "Copy it first."
        raise InputError("a character cannot be merged with itself", where=host.where, mend=mend)
    told, kind = [] if notes is None else notes, host.kind
    for one in (host, graft):
        project = set_down(RIGS[one.kind], project, one.id, time)
    if graft.root_layers:
        told.append(f"What moved {graft.where} as a whole is gone: it rides on {host.where}.")
    if isinstance(node, str):
        node = handle_number(host, node)
    if kind != graft.kind:
        for name in (host_id, graft_id):
            project = recorded(project, name, time, told)
        kind = GraphShape.kind
    project = RIGS[kind].merged(project, Merge(host_id, graft_id, time, node, at, loose, seam, told))
    return taken_up(RIGS[kind], project, host_id, host, time)


def recorded(project: Project, character_id: str, time: float, notes: list[str]) -> Project:
    """A project in which a character is a graph that plays what it did; a graph stays as it is."""
    character = project.character(character_id)
    if character.kind == GraphShape.kind:
        return project
    times, looped = _frames(project, character, time)
    stream_id = unused(character_id, project.streams)
    graph, stream, note = rig_of(character).as_graph(project, character, times, stream_id)
    if looped:
        graph = graph.with_playing(*(replace(part, loop=True) for part in graph.parts))
    notes.append(f"{character.where} was recorded from {times[0]:.2f} s to {times[-1]:.2f} s{note}.")
    return project.with_streams(stream).with_characters(graph)


def _frames(project: Project, character: RigBase, time: float) -> tuple[Float, bool]:
    """(T,) even seconds that hold all of a character's motion, ``time`` among them; and whether they loop."""
    rig = rig_of(character)
    heard = [layer for layer in character.playing if not layer.muted]
    rounds = [layer.lasting(project.length_of(layer)) for layer in heard if layer.loop]
    even = not any(layer.weights or layer.speeds for layer in heard)
    if even and rounds and len(rounds) == len(heard) and np.ptp(rounds) < 1e-9 and rounds[0] > 0.0:
        player = rig.player(project, character)
        first, last = (player(at).pose.positions for at in (time, time + rounds[0]))
        if np.abs(first - last).max() < _SAME:
            count = max(round(rounds[0] * rig.frames), 2)
            return np.asarray(time + rounds[0] / count * np.arange(count + 1, dtype=np.float64)), True
    start = min([time, *(layer.offset for layer in heard)])
    end = max([time, project.end_of(character), *([time + _LONGEST] if rounds else [])])
    before, after = np.ceil((time - start) * rig.frames), max(np.ceil((end - time) * rig.frames), 1.0)
    return np.asarray(time + np.arange(-before, after + 1.0) / rig.frames), False
