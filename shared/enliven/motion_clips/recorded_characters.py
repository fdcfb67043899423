"""Reads characters with their motion from a recorded take for editing.

    project = read_possessed("take.mcap")          # a graph shape and a stream for each possessed mesh
    shape, clip, begin = shape_and_clip_from_poses(character, poses)     # a rigged character

The file, which ``enliven run`` records, contains the transmitted characters and poses. The poses of a puppet
contain only its control points. So its surface is solved again and baked to nodes
(:mod:`enliven.examples.baking.bake`), with a note about the error.

Transmitted rigged characters contain transforms with pivots, but no joints. So the joints are reconstructed:
a bone begins at its pivot, and bones with the same pivot begin at the same joint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.document import (
    ArapSettings,
    BodyTake,
    Character,
    Clip,
    ControlPoint,
    ExampleCharacter,
    GraphCharacter,
    HoldChange,
    Pose,
    PoseStream,
    Possession,
    Project,
    RiggedCharacter,
    Skeleton,
    graph_shape_from_poses,
    still_shape,
    unused,
)
from enliven.errors import InputError
from enliven.examples.baking.bake import bake_surface
from enliven.examples.baking.frames import SurfaceFrames
from enliven.examples.baking.settings import MAX_CACHED_FRAMES_MB, BakeSettings
from enliven.meshes import Mesh
from enliven.modeling.possessed.even_steps import (
    even_times,
    interpolate_linearly,
    resample_evenly,
    stream_at_even_steps,
)
from enliven.modeling.possessed.solving import mark_as_solved
from enliven.modeling.puppet.baking import graph_from_baked_surface
from enliven.motion_clips.body_takes import RecordedHolds, body_take_from_file, read_recorded_holds
from enliven.motion_clips.edge_messages import read_messages
from enliven.recording import Recording
from enliven.rotation import conjugate, from_matrix, remove_sign_jumps, rotate, to_matrix
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
        raise InputError(
            "the recording contains no motion of a possessed mesh", where=str(path), remedy=advice
        )
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
            advice = f"Possessed characters: {', '.join(possessions) or 'none'}."
            raise InputError(f"no performer possessed {character!r}", where=str(path), remedy=advice)
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
    poses: dict[_Key, list[Pose]] = {}

    def keyed_character(message: CharacterMessage) -> tuple[_Key, Character]:
        key = (message.id, message.revision)
        # The recording repeats its messages. Convert each character only once.
        return key, characters[key] if key in characters else message_to_character(message)

    for key, character in read_messages(recording, "character", CharacterMessage, keyed_character):
        characters[key] = character
    codecs = {key: PoseCodec(character) for key, character in characters.items()}

    def keyed_pose(message: PoseMessage) -> tuple[_Key, Pose]:
        key = (message.character, message.revision)
        return key, message_to_pose(message, codecs[key])  # Poses of unknown characters are skipped.

    for key, pose in read_messages(recording, "pose", PoseMessage, keyed_pose):
        poses.setdefault(key, []).append(pose)
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
    notes.append(f"The baked surface of {character.id!r} is {surface.error}.")
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


def shape_and_clip_from_poses(
    character: Character, poses: Sequence[Pose], begin: int = 0
) -> tuple[RiggedCharacter, Clip, float]:
    """Converts a rigged character to a shape and a clip with evenly spaced frames. Also returns the time in
    seconds at which the clip begins.

    Args:
        poses: at least two poses, in the order of time.
        begin: time of the sensor's clock at 0 seconds, nanoseconds.

    Raises:
        InputError: if a bone has no parent, or there are too few poses, or they are too far apart.
    """
    linear, positions, grid = resample_evenly(character, poses, begin)
    skeleton = skeleton_from_bones(character)
    mesh = Mesh(np.asarray(character.vertices, np.float64), character.faces, character.id, character.colours)
    turns, root = from_matrix(linear), positions[:, 0]
    clip = Clip(character.id, skeleton, remove_sign_jumps(turns), root, float(grid[1] - grid[0]))
    return still_shape(character.id, skeleton, mesh, character.skin), clip, float(grid[0])


def skeleton_from_bones(character: Character) -> Skeleton:
    """Reconstructs the skeleton of a character with bones. Joint j is the end of bone j, which transform j
    moves.

    Raises:
        InputError: if a bone has no parent.
    """
    pivots: Float = np.asarray(character.pivots, np.float64)
    count = len(pivots)
    parents, positions = np.full(count, -1), np.full((count, 3), np.nan)
    positions[0] = pivots[0]
    for bone, child in character.edges:
        if 0 < bone < child and parents[child] < 0:
            parents[child], positions[bone] = bone, pivots[child]
    for bone in range(1, count):
        if parents[bone] < 0:
            begins = np.flatnonzero((positions[:bone] == pivots[bone]).all(1))
            if not len(begins):
                problem = f"bone {bone} of the character has no parent"
                raise InputError(
                    problem, where=f"character {character.id!r}", remedy="Record the character again."
                )
            parents[bone] = begins[0]
    for bone in np.flatnonzero(np.isnan(positions[:, 0])):
        positions[bone] = _limb_end(character, int(bone), pivots[bone], positions[parents[parents[bone]]])
    names = character.names or ("root", *(f"bone {bone}" for bone in range(1, count)))
    return Skeleton(names, parents.astype(np.int32), positions)


def _limb_end(character: Character, bone: int, begin: Float, previous_joint: Float) -> Float:
    """Returns the end (3,) of a limb's last bone. Its distance from the bone's start is twice that of the
    centre of the bone's vertices. Without vertices, the bone continues the previous bone in a straight line,
    with half of its length.
    """
    strongest = character.skin.indices[np.arange(len(character.vertices)), character.skin.weights.argmax(1)]
    bone_vertices = character.vertices[strongest == bone]
    return np.asarray(
        2 * bone_vertices.mean(0, np.float64) - begin
        if len(bone_vertices)
        else 1.5 * begin - 0.5 * previous_joint
    )
