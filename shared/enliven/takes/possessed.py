"""Possessed meshes out of a take: what the edge recorded of a mesh and its nodes, ready to be edited.

    project = read_possessed("take.mcap")          # a graph shape and a stream for each possessed mesh

The file is one that ``enliven run`` recorded: characters and poses as they went over the wire. Of a puppet
that was performed live the control points were recorded: its surface is solved again and baked to nodes
(:mod:`enliven.examples.baking.bake`), with a note of the error.
"""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np

from enliven.arrays import Float
from enliven.document import (
    ArapSettings,
    Character,
    ControlPoint,
    GraphShape,
    Pose,
    PoseStream,
    Project,
    Puppet,
    graph_shape_of,
    unused,
)
from enliven.errors import EnlivenError, InputError
from enliven.examples.baking import BakeSettings, SurfaceFrames, bake_surface
from enliven.files import DAMAGE
from enliven.meshes import Mesh
from enliven.modeling.puppet import graph_of
from enliven.recording import Recording
from enliven.rotation import conjugate, from_matrix, rotate, to_matrix
from enliven.wire import CharacterMessage, PoseCodec, PoseMessage, message_to_character, message_to_pose

_FEWEST = 2
"""Poses that a mesh needs at least to count as moved."""
_MOST_PLACES = 1 << 23
"""Poses at even steps times transforms, 0.8 GB: 2.6 h of 30 nodes at 30 a second."""


def read_possessed(path: str | Path, notes: list[str] | None = None) -> Project:
    """Returns the possessed meshes and puppets of a take with their motion, as a project.

    Poses come as fast as the sensor did; a stream has them at even steps, their median, mixed between
    neighbours. A mesh that was taken up again with other nodes is another shape. All begin at the time that
    they had in the take, with its first pose at 0 seconds.

    Args:
        notes: takes a sentence about the error of each baked puppet.

    Raises:
        InputError: where the file is no recording, or no possessed mesh moved in it.
    """
    recording = Recording(path)
    characters, poses = characters_and_poses(recording)
    begin = min((found[0].time_ns for found in poses.values() if found), default=0)
    project = Project()
    for key, character in characters.items():
        found = poses.get(key, [])
        if character.kind not in ("graph", "points") or len(found) < _FEWEST:
            continue
        told: list[str] = [] if notes is None else notes
        shape, stream = played(character, found, begin, project, told)
        project = project.with_streams(stream).with_characters(shape)
    if not project.graphs:
        mend = "Possess a mesh and record it: enliven run."
        raise InputError("no possessed mesh moves in it", where=str(path), mend=mend)
    return project


_Key = tuple[str, int]
"""The id and the revision of a character."""


def characters_and_poses(recording: Recording) -> tuple[dict[_Key, Character], dict[_Key, list[Pose]]]:
    """Returns characters and poses by id and revision; a message that cannot be read is left out."""
    characters: dict[_Key, Character] = {}
    codecs: dict[_Key, PoseCodec] = {}
    poses: dict[_Key, list[Pose]] = {}
    for _, data in recording.messages("character") if "character" in recording.info.topics else ():
        try:
            message = msgspec.msgpack.decode(data, type=CharacterMessage)
            if (message.id, message.revision) in characters:
                continue  # a take holds copies
            character = message_to_character(message)
        except (msgspec.MsgspecError, EnlivenError, *DAMAGE):
            continue
        key = (character.id, message.revision)
        characters[key], codecs[key] = character, PoseCodec(character)
    for _, data in recording.messages("pose") if "pose" in recording.info.topics else ():
        try:
            said = msgspec.msgpack.decode(data, type=PoseMessage)
            key = (said.character, said.revision)
            if key in codecs:
                poses.setdefault(key, []).append(message_to_pose(said, codecs[key]))
        except (msgspec.MsgspecError, EnlivenError, *DAMAGE):
            continue
    return characters, {key: sorted(found, key=lambda pose: pose.time_ns) for key, found in poses.items()}


def played(
    character: Character, poses: list[Pose], begin: int, project: Project, notes: list[str]
) -> tuple[GraphShape, PoseStream]:
    """Returns the shape of a character, and the stream of its poses at even steps."""
    poses, seconds, grid = even_times(character, poses, begin)
    step = float(grid[1] - grid[0])
    ids = unused(character.id, project.characters), unused(character.id, project.streams)
    if character.kind == "points":
        return _solved(character, poses, seconds, grid, ids, notes)
    shape, whole = graph_shape_of(character, poses, ids[1], step)
    linear, positions = (between(values, seconds, grid) for values in (whole.linear, whole.positions))
    stream = PoseStream(whole.id, linear, positions, step)
    part = shape.parts[0]
    moved = type(part)(part.take, part.nodes, offset=float(seconds[0]))
    return shape.with_changes(id=ids[0], parts=(moved,)), stream


def even_times(character: Character, poses: list[Pose], begin: int) -> tuple[list[Pose], Float, Float]:
    """Returns the poses of different times, those (F,) in seconds since ``begin`` (ns), and (G,) even times.

    Raises:
        InputError: where there are too few, or times that are too far apart.
    """
    where = f"character {character.id!r}"
    seconds = np.array([(pose.time_ns - begin) / 1e9 for pose in poses])
    _, first = np.unique(seconds, return_index=True)
    seconds = seconds[first]
    if len(first) < _FEWEST:
        raise InputError("all its poses are of one moment", where=where, mend="Record it again.")
    step, lasts = float(np.median(np.diff(seconds))), float(seconds[-1] - seconds[0])
    if lasts / step * len(character.pivots) > _MOST_PLACES:
        what = f"its poses are spread over {lasts:.3g} s, at steps of {step:.3g} s: too many"
        raise InputError(what, where=where, mend="Record a shorter take.")
    return [poses[i] for i in first], seconds, np.arange(seconds[0], seconds[-1] + 0.5 * step, step)


def _solved(
    character: Character,
    poses: list[Pose],
    seconds: Float,
    grid: Float,
    ids: tuple[str, str],
    notes: list[str],
) -> tuple[GraphShape, PoseStream]:
    """Returns a puppet's baked shape and stream: its surface is solved at the times ``grid`` (G,)."""
    turns = from_matrix(np.array([pose.linear[0] for pose in poses], np.float64))
    world = np.array([pose.positions for pose in poses], np.float64)
    local = rotate(conjugate(turns)[:, None], world[:, 1:] - world[:, :1])
    turns = from_matrix(between(to_matrix(turns), seconds, grid))
    puppet = _puppet_of(character)
    settings, places = BakeSettings(), between(local, seconds, grid)
    held = [point.vertex for point in puppet.points]
    surface = bake_surface(puppet.mesh, SurfaceFrames(puppet, places, settings.kept), places, held, settings)
    notes.append(f"The surface of {character.id!r} was baked, {surface.error}.")
    roots, step = between(world[:, 0], seconds, grid), float(grid[1] - grid[0])
    return graph_of(puppet.mesh, surface, turns, roots, step, ids, float(seconds[0]))


def _puppet_of(character: Character) -> Puppet:
    """Returns the puppet of a character: its mesh with its control points, without layers."""
    assert character.held is not None
    pulls = np.zeros(len(character.held)) if character.pulls is None else character.pulls
    points = tuple(
        ControlPoint(str(number), int(vertex), weight=float(pull) or None)
        for number, (vertex, pull) in enumerate(zip(character.held, pulls, strict=True))
    )
    vertices = character.vertices.astype(np.float64)
    mesh = Mesh(vertices, character.faces, character.id, character.colours)
    return Puppet(character.id, mesh, points, surface=character.surface or ArapSettings())


def between(values: Float, seconds: Float, grid: Float) -> Float:
    """Returns (G, ...) ``values`` (F, ...) interpolated from ``seconds`` (F,) to ``grid`` (G,)."""
    before = np.clip(np.searchsorted(seconds, grid, side="right") - 1, 0, len(seconds) - 2)
    share = np.clip((grid - seconds[before]) / (seconds[before + 1] - seconds[before]), 0.0, 1.0)
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((1 - share) * values[before] + share * values[before + 1])
