"""Reads possessed meshes, with the motion of their nodes, from a recorded take for editing.

    project = read_possessed("take.mcap")          # a graph shape and a stream for each possessed mesh

The file, which ``enliven run`` records, contains the transmitted characters and poses. The poses of a puppet
contain only its control points. So its surface is solved again and baked to nodes
(:mod:`enliven.examples.baking.bake`), with a note about the error.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

from enliven.arrays import Float
from enliven.document import (
    ArapSettings,
    BodyTake,
    Character,
    ControlPoint,
    ExampleCharacter,
    GraphCharacter,
    HoldChange,
    Pose,
    PoseStream,
    Possession,
    Project,
    graph_shape_from_poses,
    unused,
)
from enliven.errors import EnlivenError, InputError
from enliven.examples.baking.bake import bake_surface
from enliven.examples.baking.frames import SurfaceFrames
from enliven.examples.baking.settings import MAX_CACHED_FRAMES_MB, BakeSettings
from enliven.files import DAMAGE
from enliven.meshes import Mesh
from enliven.modeling.possessed.even_steps import even_times, interpolate_linearly, stream_at_even_steps
from enliven.modeling.possessed.solving import mark_as_solved
from enliven.modeling.puppet.baking import graph_from_baked_surface
from enliven.recording import Recording
from enliven.rotation import conjugate, from_matrix, rotate, to_matrix
from enliven.takes.body_takes import RecordedHolds, body_take_from_file, read_recorded_holds
from enliven.wire import (
    HOLDS,
    CharacterMessage,
    PoseCodec,
    PoseMessage,
    message_to_character,
    message_to_pose,
)

_MIN_MOVING_POSES = 2
"""Minimum number of poses of a mesh that moved."""


def read_possessed(path: str | Path, notes: list[str] | None = None) -> Project:
    """Reads the possessed meshes and puppets of a take with their motion, as a project.

    Poses were recorded at the sensor's rate. For a stream, they are interpolated at evenly spaced times with
    their median interval. A mesh that was possessed again with other nodes becomes another shape. Every
    stream begins at its time in the take. The first pose of the take is at 0 seconds.

    Args:
        notes: list to which a sentence about the error of each baked puppet is appended.

    Raises:
        InputError: if the file is not a recording, or no possessed mesh moved in it.
    """
    recording = Recording(path)
    characters, poses = read_characters_and_poses(recording)
    begin = min((own_poses[0].time_ns for own_poses in poses.values() if own_poses), default=0)
    project, holds = Project(), read_recorded_holds(recording, Path(path).stem)
    for key, character in characters.items():
        own_poses = poses.get(key, [])
        if character.kind not in ("graph", "points") or len(own_poses) < _MIN_MOVING_POSES:
            continue
        messages: list[str] = [] if notes is None else notes
        project = add_character_motion(project, key, character, own_poses, begin, messages, holds)
    if not project.graphs:
        advice = "Possess a mesh and record it: enliven run."
        raise InputError("it contains no motion of a possessed mesh", where=str(path), remedy=advice)
    return project


def read_possession(path: str | Path, character: str = "") -> tuple[Project, str, BodyTake, Possession]:
    """Reads the performers in a recording that moved a possessed mesh.

    Args:
        character: id of a possessed mesh. Empty means the first possessed mesh.

    Returns:
        The recording as a project, the mesh's id, its performers, and the record of their attachments. If the
        recording contains no attachments, the id is empty, and the record lets the first performer attach at
        the start.

    Raises:
        InputError: if the file is not a recording, the character does not exist, or no performer is in it.
    """
    path = Path(path)
    if HOLDS.name in Recording(path).info.topics:
        project = read_possessed(path)
        possessions = {k: p.possession for k, g in project.graphs.items() for p in g.parts if p.possession}
        if character and character not in possessions:
            advice = f"Known: {', '.join(possessions) or 'none'}."
            raise InputError(f"nobody possessed {character!r}", where=str(path), remedy=advice)
        for name, possession in possessions.items():
            if not character or name == character:
                return project, name, project.bodies[possession.take], possession
    bodies = body_take_from_file(path)
    return Project(), "", bodies, Possession(bodies.id, (HoldChange(0.0),))


_Key = tuple[str, int]
"""The id and the revision of a character."""


def read_characters_and_poses(recording: Recording) -> tuple[dict[_Key, Character], dict[_Key, list[Pose]]]:
    """Reads characters and poses by id and revision. Unreadable messages are skipped."""
    characters: dict[_Key, Character] = {}
    codecs: dict[_Key, PoseCodec] = {}
    poses: dict[_Key, list[Pose]] = {}
    for _, data in recording.messages("character") if "character" in recording.info.topics else ():
        try:
            message = msgspec.msgpack.decode(data, type=CharacterMessage)
            if (message.id, message.revision) in characters:
                continue  # The recording repeats its messages, so skip those that were read before.
            character = message_to_character(message)
        except (msgspec.MsgspecError, EnlivenError, *DAMAGE):
            continue
        key = (character.id, message.revision)
        characters[key], codecs[key] = character, PoseCodec(character)
    for _, data in recording.messages("pose") if "pose" in recording.info.topics else ():
        try:
            pose_message = msgspec.msgpack.decode(data, type=PoseMessage)
            key = (pose_message.character, pose_message.revision)
            if key in codecs:
                poses.setdefault(key, []).append(message_to_pose(pose_message, codecs[key]))
        except (msgspec.MsgspecError, EnlivenError, *DAMAGE):
            continue
    return characters, {
        key: sorted(own_poses, key=lambda pose: pose.time_ns) for key, own_poses in poses.items()
    }


def add_character_motion(
    project: Project,
    key: _Key,
    character: Character,
    poses: list[Pose],
    begin: int,
    notes: list[str],
    holds: RecordedHolds | None,
) -> Project:
    """Adds the recorded motion of a character to a project, resampled to even steps.

    A possessed mesh is added with its performers and can be solved again. Its motion begins when they appear.

    Args:
        key: id and revision of the character.
        begin: time of the sensor's clock at 0 seconds of the project, nanoseconds.
        holds: the performers and their attachments in the recording, or None.
    """
    ids = unused(character.id, project.characters), unused(character.id, project.streams)
    if character.kind == "points":
        poses, seconds, grid = even_times(character, poses, begin)
        shape, stream = _bake_puppet(character, poses, seconds, grid, ids, notes)
        return project.with_streams(stream).with_characters(shape)
    later_poses = [] if holds is None else [pose for pose in poses if pose.time_ns >= holds.begin_ns]
    possession = None
    if holds is not None and len(later_poses) >= _MIN_MOVING_POSES:
        possession = holds.possession(key, character, later_poses)
        poses = poses if possession is None else later_poses
    stream = stream_at_even_steps(character, poses, ids[1])
    shape, _ = graph_shape_from_poses(character, poses, ids[1], stream.step)
    start = (poses[0].time_ns - begin) * 1e-9
    part = replace(shape.parts[0], offset=start, possession=possession)
    shape = shape.with_changes(id=ids[0], parts=(part,))
    if holds is not None and possession is not None:
        project = project.with_bodies(holds.take)
    return mark_as_solved(project.with_streams(stream).with_characters(shape), shape.id)


def _bake_puppet(
    character: Character,
    poses: list[Pose],
    seconds: Float,
    grid: Float,
    ids: tuple[str, str],
    notes: list[str],
) -> tuple[GraphCharacter, PoseStream]:
    """Bakes a puppet to a graph shape and a stream. Its surface is solved at the times ``grid`` (G,),
    seconds."""
    turns = from_matrix(np.array([pose.linear[0] for pose in poses], np.float64))
    world = np.array([pose.positions for pose in poses], np.float64)
    local = rotate(conjugate(turns)[:, None], world[:, 1:] - world[:, :1])
    turns = from_matrix(interpolate_linearly(to_matrix(turns), seconds, grid))
    puppet = _puppet_from_character(character)
    settings, places = BakeSettings(), interpolate_linearly(local, seconds, grid)
    point_vertices = [point.vertex for point in puppet.points]
    surface = bake_surface(
        puppet.mesh, SurfaceFrames(puppet, places, MAX_CACHED_FRAMES_MB), places, point_vertices, settings
    )
    notes.append(f"The surface of {character.id!r} was baked, {surface.error}.")
    roots, step = interpolate_linearly(world[:, 0], seconds, grid), float(grid[1] - grid[0])
    return graph_from_baked_surface(puppet.mesh, surface, turns, roots, step, ids, float(seconds[0]))


def _puppet_from_character(character: Character) -> ExampleCharacter:
    """Converts a character back to a puppet: its mesh with its control points, without layers."""
    assert character.held is not None
    pulls = np.zeros(len(character.held)) if character.pulls is None else character.pulls
    points = tuple(
        ControlPoint(str(number), int(vertex), weight=float(pull) or None)
        for number, (vertex, pull) in enumerate(zip(character.held, pulls, strict=True))
    )
    vertices = character.vertices.astype(np.float64)
    mesh = Mesh(vertices, character.faces, character.id, character.colours)
    return ExampleCharacter(character.id, mesh, points, surface=character.surface or ArapSettings())
