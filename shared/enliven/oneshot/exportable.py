"""Finds the moving characters in a file. ``enliven export`` can choose from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from enliven.document import Character, Clip, Pose, Project, RigBase, RiggedCharacter, unused
from enliven.errors import InputError
from enliven.exporters import Performance, Representation, performance_of_clip, sample_performance
from enliven.formats.gltf.read import read_gltf
from enliven.formats.project.file import read_project
from enliven.formats.rig.rig import play_clip
from enliven.meshes import GLTF_SUFFIXES
from enliven.modeling.edits import get_rig_edits
from enliven.modeling.possessed.solving import solve_lost
from enliven.motion_clips.clip_sampling import resample_clip, trim_clip
from enliven.motion_clips.recorded_characters import (
    add_character_motion,
    read_characters_and_poses,
    shape_and_clip_from_poses,
)
from enliven.motion_clips.take_files import read_take
from enliven.motion_clips.tracked_people import TakeSettings, clips_of_frames, read_body_frames
from enliven.recording import DEPTH_TOPIC, Recording
from enliven.sounds import Sound

Sample = Callable[[float, float | None, float | None, Representation, bool], Performance]
"""A function that samples a performance. Its parameters are: start in seconds, end in seconds or None, frames
per second or None for the native rate, the form of puppets' surfaces, and True to use the clips' own keys.
"""
_DEFAULT_FRAMES_PER_SECOND = 30.0
"""Frames per second of motion without its own rate. It is the rate of the sensors."""


@dataclass(frozen=True)
class Exportable:
    """A character, a person or an animation in a file. Its motion is sampled only on request.

    Attributes:
        name: name that is unique in the file.
        sample: a function that creates the performance.
        jointed: True if it has a skeleton.
        solid: True if it has a surface.
        rank: 0 for the main content of the file, 1 for content that is used only if no content of rank 0 is
            suitable.
    """

    name: str
    sample: Sample
    jointed: bool = False
    solid: bool = True
    rank: int = 0


class Exportables(NamedTuple):
    """All exportable content of a file.

    Attributes:
        items: the moving characters.
        notes: sentences about the file.
        sounds: sounds that belong to the performance.
    """

    items: list[Exportable]
    notes: tuple[str, ...] = ()
    sounds: tuple[Sound, ...] = ()


def find_exportables(path: Path | str) -> Exportables:
    """Returns the exportable content of a recording, a project, a model or a motion file.

    Times are in seconds of the project or clip. In a recording, they start at the first pose, or when a
    person appears.

    Raises:
        InputError: if the file cannot be read, or nothing moves in it.
    """
    path, notes, sounds = Path(path), tuple[str, ...](), tuple[Sound, ...]()
    kind = path.suffix.lower()
    if kind == ".enliven":
        project = solve_lost(read_project(path))
        exportables, sounds = _exportables_from_project(project), tuple(project.sounds.values())
    elif kind == ".mcap":
        exportables = _exportables_from_recording(path)
    elif kind in GLTF_SUFFIXES:
        rig = read_gltf(path)
        exportables, notes = _exportables_from_model(rig.shape, rig.clips), rig.notes
    else:
        clip, notes = read_take(path)
        exportables = [_exportable_from_clip(clip)]
    if not exportables:
        remedy = (
            "Record a performance that lasts longer." if kind == ".mcap" else "Animate a character first."
        )
        if kind == ".mcap" and DEPTH_TOPIC in Recording(path).info.topics:
            remedy = f"Track the people in the depth images first: enliven track {path.name} -o bodies.mcap"
        raise InputError("the file contains no motion", where=str(path), remedy=remedy)
    return Exportables(exportables, notes, sounds)


def _exportables_from_project(project: Project) -> list[Exportable]:
    """Returns the rigged shapes, possessed meshes and puppets with motion, followed by the takes."""
    exportables = list[Exportable]()
    for character in project.characters.values():
        if not get_rig_edits(character).find_missing_data(project, character):
            exportables.append(_exportable_character(project, character))
    return [*exportables, *(_exportable_from_clip(clip, 1) for clip in project.takes.values())]


def _exportables_from_model(shape: RiggedCharacter, clips: tuple[Clip, ...]) -> list[Exportable]:
    """Returns the animations of a model in order, or the static model if it has no animations."""
    if not clips:
        return [_exportable_character(Project().with_characters(shape), shape)]
    exportables = list[Exportable]()
    for clip in clips:
        project, character_id = play_clip(Project(), shape, clip)
        sample = partial(_sample_character, project, character_id, own=1 / clip.step)
        exportables.append(
            Exportable(clip.id, sample, True, shape.mesh is not None, min(len(exportables), 1))
        )
    return exportables


def _exportables_from_recording(path: Path) -> list[Exportable]:
    """Returns characters with their recorded poses, and then the people."""
    recording = Recording(path)
    characters, poses = read_characters_and_poses(recording)
    moving = {key: own_poses for key, own_poses in poses.items() if len(own_poses) > 1}
    begin_ns = min((own_poses[0].time_ns for own_poses in moving.values()), default=0)
    exportables = dict[str, Exportable]()
    for key, own_poses in moving.items():
        character, name = characters[key], unused(characters[key].id, exportables)
        sample = partial(_sample_recorded, name, character, own_poses, begin_ns)
        exportables[name] = Exportable(name, sample, character.kind == "bones")
    for clip in clips_of_frames(read_body_frames(recording), path.stem, TakeSettings()):
        name = unused(clip.id, exportables)
        exportables[name] = _exportable_from_clip(replace(clip, id=name), 1)
    return list(exportables.values())


def _exportable_character(project: Project, character: RigBase) -> Exportable:
    jointed, solid = bool((character.parents >= 0).any()), character.mesh is not None
    return Exportable(character.id, partial(_sample_character, project, character), jointed, solid)


def _exportable_from_clip(clip: Clip, rank: int = 0) -> Exportable:
    return Exportable(clip.id, partial(_sample_clip, clip), True, True, rank)


def _sample_character(
    project: Project,
    character: RigBase,
    start: float,
    end: float | None,
    rate: float | None,
    how: Representation,
    keyed: bool,
    own: float = _DEFAULT_FRAMES_PER_SECOND,
) -> Performance:
    """Samples a character of a project, at its ``own`` frames per second if no other rate is requested."""
    keyed = keyed and rate is None
    return sample_performance(project, character, start, end, rate or own, how=how, keyed=keyed)


def _sample_recorded(
    name: str,
    character: Character,
    poses: list[Pose],
    begin: int,
    start: float,
    end: float | None,
    rate: float | None,
    how: Representation,
    keyed: bool,
) -> Performance:
    """Samples a character of a live performance, as a rigged shape or as a possessed mesh."""
    if character.kind == "bones":
        still_shape, clip, offset = shape_and_clip_from_poses(replace(character, id=name), poses, begin)
        project, shape = play_clip(Project(), still_shape, clip)
        later_shape = shape.delay_motion(offset)
        return _sample_character(
            project.with_characters(later_shape), later_shape, start, end, rate, how, keyed, 1 / clip.step
        )
    renamed_character = replace(character, id=name)
    project = add_character_motion(Project(), (name, 0), renamed_character, poses, begin, [], None)
    (graph,), (stream,) = project.graphs.values(), project.streams.values()
    return _sample_character(project, graph, start, end, rate, how, keyed, 1 / stream.step)


def _sample_clip(clip: Clip, start: float, end: float | None, rate: float | None, *_: object) -> Performance:
    """Samples frames of a clip. Raises InputError if the range contains no frames."""
    stop_s = clip.duration if end is None else end
    if start > clip.duration or stop_s < start:
        problem = f"the clip lasts {clip.duration:.2f} s: there is no motion from {start:g} s to {stop_s:g} s"
        raise InputError(problem, where=f"clip {clip.id!r}", remedy="Choose another start and end.")
    trimmed_clip = trim_clip(clip, start, stop_s)
    return performance_of_clip(trimmed_clip if rate is None else resample_clip(trimmed_clip, 1 / rate))
