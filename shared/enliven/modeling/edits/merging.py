"""Merges two characters in their poses at a given time. Their rigs may be of the same kind or of different
kinds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import GraphCharacter, Project, RigBase, unused
from enliven.errors import InputError
from enliven.modeling.edits.rigs import RIGS, get_rig_edits, handle_number
from enliven.modeling.edits.root_motion_rig import remove_root_layers, restore_root_layers
from enliven.modeling.mesh.seam import SeamSettings
from enliven.modeling.rig import Merge

_DEFAULT_SEAM = SeamSettings()
_LOOPED_RECORDING_S = 20.0
"""Seconds that are recorded after a merge if loops have different lengths or do not end at their start."""
_SAME_POINT_M = 1e-6
"""Maximum distance in metres between the start and end of a closed loop, to allow for rounding."""


def merge_characters(
    project: Project,
    host_id: str,
    graft_id: str,
    time: float,
    *,
    node: int | str | None = None,
    at: float = 1.0,
    loose: bool = False,
    seam: SeamSettings = _DEFAULT_SEAM,
    notes: list[str] | None = None,
) -> Project:
    """Merges two characters in their poses at ``time``: attaches the graft to the host.

    At ``time`` both keep their positions. Afterwards both keep moving, and the graft follows the host. Keys
    that move the whole host then move both, and keys of the whole graft are removed.

    Two characters with the same kind of rig keep this kind. Two different kinds of rigs become one
    deformation graph, in which each side is a part with its own time. A side that already is a deformation
    graph stays unchanged. The bones of a skeleton become nodes, which is exact at 60 frames per second and at
    ``time``. A puppet is baked, and ``notes`` receives the error. Baked parts lose their joints and key poses
    (undo restores them). The baked motion ends when each take was played once. A loop repeats for ever if its
    end matches its start, and otherwise plays for 20 seconds.

    Args:
        node, at, loose, seam, notes: as in :class:`enliven.modeling.rig.Merge`.

    Raises:
        InputError: if a character is merged with itself, the node does not exist, or the union of the meshes
            fails.
    """
    host, graft = project.character(host_id), project.character(graft_id)
    if host_id == graft_id:
        remedy = "Copy the character first, and merge it with the copy."
        raise InputError("a character cannot be merged with itself", where=host.where, remedy=remedy)
    messages, kind = [] if notes is None else notes, host.kind
    for character in (host, graft):
        project = remove_root_layers(RIGS[character.kind], project, character.id, time)
    if graft.root_layers:
        messages.append(
            f"The motion of {graft.where} as a whole was removed. {graft.where} now follows {host.where}."
        )
    if isinstance(node, str):
        node = handle_number(host, node)
    if kind != graft.kind:
        for name in (host_id, graft_id):
            project = bake_to_graph(project, name, time, messages)
        kind = GraphCharacter.kind
    project = RIGS[kind].merge(project, Merge(host_id, graft_id, time, node, at, loose, seam, messages))
    return restore_root_layers(RIGS[kind], project, host_id, host, time)


def bake_to_graph(project: Project, character_id: str, time: float, notes: list[str]) -> Project:
    """Bakes a character's motion to a deformation graph. A character that already is a deformation graph
    stays unchanged."""
    character = project.character(character_id)
    if character.kind == GraphCharacter.kind:
        return project
    times, looped = _frame_times(project, character, time)
    stream_id = unused(character_id, project.streams)
    graph, stream, note = get_rig_edits(character).convert_to_graph_shape(
        project, character, times, stream_id
    )
    if looped:
        graph = graph.with_playing(*(replace(part, loop=True) for part in graph.parts))
    notes.append(
        f"The motion of {character.where} was baked from {times[0]:.2f} s to {times[-1]:.2f} s{note}."
    )
    return project.with_streams(stream).with_characters(graph)


def _frame_times(project: Project, character: RigBase, time: float) -> tuple[Float, bool]:
    """Returns (T,) evenly spaced seconds that cover a character's motion and include ``time``, and True if
    the motion is a loop."""
    rig = get_rig_edits(character)
    audible_layers = [layer for layer in character.playing if not layer.muted]
    loop_lengths = [
        layer.compute_loop_duration(project.length_of(layer)) for layer in audible_layers if layer.loop
    ]
    step_times = not any(layer.weights or layer.speeds for layer in audible_layers)
    if (
        step_times
        and loop_lengths
        and len(loop_lengths) == len(audible_layers)
        and np.ptp(loop_lengths) < 1e-9
        and loop_lengths[0] > 0.0
    ):
        player = rig.create_player(project, character)
        first, last = (player(moment).pose.positions for moment in (time, time + loop_lengths[0]))
        if np.abs(first - last).max() < _SAME_POINT_M:
            count = max(round(loop_lengths[0] * rig.frames), 2)
            return np.asarray(time + loop_lengths[0] / count * np.arange(count + 1, dtype=np.float64)), True
    start = min([time, *(layer.offset for layer in audible_layers)])
    end = max([time, project.end_of(character), *([time + _LOOPED_RECORDING_S] if loop_lengths else [])])
    frames_before, frames_after = (
        np.ceil((time - start) * rig.frames),
        max(np.ceil((end - time) * rig.frames), 1.0),
    )
    return np.asarray(time + np.arange(-frames_before, frames_after + 1.0) / rig.frames), False
