"""Adds models, meshes, takes and sessions from files to the project."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from enliven.document import Clip, ExampleCharacter, Project, RigBase, are_identical, unused
from enliven.errors import InputError
from enliven.example_sessions.session import Session, read_session
from enliven.example_sessions.text import write_session
from enliven.exporters import suffixes
from enliven.formats.gltf.read import NO_RIG_NOTE, read_gltf
from enliven.formats.project.file import read_project
from enliven.formats.project.one_character import project_of_mesh
from enliven.formats.rig.rig import Rig, scale_to_height
from enliven.mapping.model_clips import clip_to_open, find_played_clip, list_own_clips, play_own_clip
from enliven.meshes import GLTF_SUFFIXES, Mesh, fit_height, load_mesh
from enliven.modeling.edits import compute_vertices, get_rig_edits, move_character, paste_character
from enliven.modeling.puppet.edits import make_puppet
from enliven.motion_clips.recorded_characters import read_possessed
from enliven.motion_clips.take_files import read_take
from enliven.motion_clips.tracked_people import read_recorded_clips
from enliven.samples.shipped import dancing_cactus, load_sample
from enliven_viewer.language import later, tr
from enliven_viewer.studio.app.contributions import FileType
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.editor.path_framing import frame_path
from enliven_viewer.studio.workspace.model_size import choose_size

MODEL_SUFFIXES = GLTF_SUFFIXES
MESH_SUFFIXES = (".obj", ".ply", ".stl", ".off")
TAKE_SUFFIXES = (".bvh", ".txt")
PERFORMANCE_SUFFIXES = (".mcap",)
SESSION_SUFFIXES = (".toml",)
FILM_SUFFIX = ".mp4"
EXPORT_SUFFIXES = (".glb", *(ending for ending in suffixes() if ending not in (".glb", FILM_SUFFIX)))
SAMPLES = {"cactus": "Dancing cactus", "chair": "Armchair", "lamp": "Desk lamp"}
"""Samples that ship with enliven, by id, with their labels."""
_MAX_NOTE_LETTERS = 130
"""Maximum length of a displayed note about a file, in characters."""
_CHARACTER_GAP_M = 0.3
"""Distance in metres between an opened model and the existing characters."""


def add_file(editor: Editor, path: Path, types: Sequence[FileType] | None = None) -> None:
    """Adds a model, a mesh, a take or a session to the project. A mesh without a rig becomes a puppet.

    Args:
        types: the types of files; None for :data:`FILE_TYPES`.

    Raises:
        InputError: if the file cannot be read, or its type is not supported.
    """
    add, value = read_addable_file(path, FILE_TYPES if types is None else types)
    add(editor, path, value)


def read_addable_file(
    path: Path, types: Sequence[FileType]
) -> tuple[Callable[[Editor, Path, Any], None], Any]:
    """Reads a file.

    Returns the function that adds it to the project, and the content. Reading may run in a thread.

    Raises:
        InputError: if the file cannot be read, or its type is not supported.
    """
    ending = path.suffix.lower()
    for file_type in types:
        if ending in file_type.suffixes:
            return file_type.add, file_type.read(path)
    known_endings = ", ".join(list_suffixes(types))
    problem = tr("{0} is an unknown file type", ending) if ending else tr("the file name has no extension")
    raise InputError(problem, where=str(path), remedy=tr("Known: {0}.", known_endings))


def list_suffixes(types: Sequence[FileType]) -> tuple[str, ...]:
    """Returns the extensions of all file types."""
    return tuple(suffix for file_type in types for suffix in file_type.suffixes)


def add_sample(editor: Editor, name: str) -> None:
    """Adds a sample of enliven: a character that plays a motion, a mesh to possess, or a puppet to animate by
    examples.
    """
    if name == "cactus":
        _add_playing_character(editor, "cactus", dancing_cactus(), name, ())
        editor.playing = True
    elif name == "chair":
        _add_playing_character(editor, name, project_of_mesh(load_sample(name), name), name, ())
    elif name == "lamp":
        _add_puppet(editor, Path(name), load_sample(name), ())


def list_exportable(project: Project) -> list[RigBase]:
    """Returns the characters that have a surface and all inputs that they need to move.

    Raises:
        InputError: if no character can be exported. The message says what the first character lacks.
    """
    solid = [character for character in project.characters.values() if character.mesh is not None]
    lacking = [get_rig_edits(character).find_missing_data(project, character) for character in solid]
    movable = [character for character, lacks in zip(solid, lacking, strict=True) if not lacks]
    if not movable:
        remedy = " ".join(lacking[0]) if lacking else tr("Sketch a shape, or open a model.")
        raise InputError(tr("no shape has both a surface and motion"), where="export", remedy=remedy)
    return movable


def save_session(project: Project, puppet_id: str, path: Path) -> None:
    """Writes a puppet with its examples as a session, and a project file with its mesh and takes next to it.

    Raises:
        InputError: if the puppet does not exist.
        ResourceError: if the file cannot be written.
    """
    write_session(path, project, puppet_id)


def _add_model(editor: Editor, path: Path, rig: Rig) -> None:
    if rig.shape.mesh is not None and len(rig.shape.skeleton) == 2 and not rig.clips:
        # Drop the note about the placeholder bone, because a puppet has no bones.
        _add_puppet(editor, path, rig.shape.mesh, tuple(note for note in rig.notes if note != NO_RIG_NOTE))
        return
    size = choose_size(rig.shape.skeleton.positions if rig.shape.mesh is None else rig.shape.mesh.vertices)
    if size.note:
        rig = replace(scale_to_height(rig, size.height), notes=(size.note, *rig.notes))
    box, added_ids = editor.measure_bounds(), list[str]()

    def add(project: Project) -> Project:
        shape = rig.shape.with_changes(id=unused(rig.shape.id, project.characters))
        added_ids.append(shape.id)
        if box is not None and shape.mesh is not None:
            aside = float(box[1][0] - shape.mesh.bounds[0, 0]) + _CHARACTER_GAP_M
            shape = shape.with_changes(place=[aside, 0.0, 0.0])
        project, names = _add_clips(project.with_characters(shape), rig.clips)
        first = clip_to_open(shape, rig.clips)
        return project if first is None else play_own_clip(project, shape.id, names[first.id])

    if editor.edit(later("open {0}", path.name), add):
        editor.select_only(added_ids[-1])
        _show_notes(editor, path, rig.notes, _make_clip_note(editor.project, added_ids[-1]))
        frame_path(editor)


def _add_clips(project: Project, clips: Sequence[Clip]) -> tuple[Project, dict[str, str]]:
    """Returns the project with a model's clips added, and the name in the project of each clip.

    Identical existing clips are not added again.
    """
    names = dict[str, str]()
    for clip in clips:
        existing = project.takes.get(clip.id)
        if existing is not None and are_identical(existing, clip):
            names[clip.id] = clip.id
            continue
        names[clip.id] = unused(clip.id, project.takes)
        project = project.with_takes(replace(clip, id=names[clip.id]))
    return project, names


def _make_clip_note(project: Project, shape_id: str) -> str:
    """Returns a sentence about the clip that an opened model plays, and about the location of its other
    clips.
    """
    shape = project.shape(shape_id)
    clips, played_clip = list_own_clips(project, shape), find_played_clip(project, shape)
    if played_clip is None:
        return tr("The file also contained {0} takes.", len(clips)) if clips else ""
    clip_note = (
        tr(" The model has {0} clips: choose a clip at the right.", len(clips)) if len(clips) > 1 else ""
    )
    return tr("Space plays {0}.{1}", played_clip, clip_note)


def _add_mesh(editor: Editor, path: Path, read: tuple[Mesh, Sequence[str]]) -> None:
    mesh, notes = read
    _add_puppet(editor, path, mesh, tuple(notes))


def _add_puppet(editor: Editor, path: Path, mesh: Mesh, notes: tuple[str, ...]) -> None:
    """Adds a mesh without a rig as a puppet, standing on the floor.

    An implausible size is changed to the height of a person.
    """
    size = choose_size(mesh.vertices)
    box, added_ids = editor.measure_bounds(), []
    fitted = fit_height(mesh, size.height)
    if size.note:
        notes = (size.note, *notes)

    def add(project: Project) -> Project:
        everything = project.characters
        name = unused(path.stem, everything)
        project = make_puppet(project, fitted, name)
        added_ids.append(name)
        if box is None:
            return project
        aside = float(box[1][0] - fitted.vertices[:, 0].min()) + _CHARACTER_GAP_M
        return move_character(project, name, [aside, 0.0, 0.0])

    if editor.edit(later("open {0}", path.name), add):
        editor.select_only(added_ids[-1])
        _show_notes(editor, path, notes, tr("The mesh is now a puppet: press K to put control points on it."))
        frame_path(editor)


def _add_session(editor: Editor, path: Path, session: Session) -> None:
    _add_playing_character(editor, path.name, session.project, session.puppet, session.notes)


def _add_playing_character(
    editor: Editor, file_name: str, source: Project, character: str, notes: tuple[str, ...]
) -> None:
    """Adds a character of another project, with the motion that it plays."""
    added_ids: list[str] = []
    box, low = editor.measure_bounds(), compute_vertices(source, character, 0.0)[:, 0].min()

    def add(project: Project) -> Project:
        project = project.with_takes(*(t for t in source.takes.values() if t.id not in project.takes))
        project, name = paste_character(project, source, character)
        added_ids.append(name)
        if box is None:
            return project
        return move_character(project, name, [float(box[1][0] - low) + _CHARACTER_GAP_M, 0.0, 0.0])

    if editor.edit(later("open {0}", file_name), add):
        editor.select_only(added_ids[-1])
        _show_notes(editor, Path(file_name), notes, "")
        frame_path(editor)


def _add_take(editor: Editor, path: Path, read: tuple[Clip, tuple[str, ...]]) -> None:
    clip, notes = read

    def add(project: Project) -> Project:
        return project.with_takes(replace(clip, id=unused(path.stem, project.takes)))

    if editor.edit(later("open {0}", path.name), add):
        puppet = editor.find_selected(ExampleCharacter)
        remedy = (
            tr("Choose the take in the performer's view, so that {0} follows it.", puppet.id)
            if puppet
            else tr("Press M to map the take onto a shape.")
        )
        _show_notes(editor, path, notes, remedy)


def _add_performance(editor: Editor, path: Path, read: _RecordedTake) -> None:
    added: list[str] = []
    old_names = set(editor.project.characters)

    def add(project: Project) -> Project:
        project, names = _add_performed(project, path, read)
        added.extend(names)
        return project

    if editor.edit(later("open {0}", path.name), add):
        remedy = tr("You can cut and merge possessed characters.")
        puppet = editor.find_selected(ExampleCharacter)
        if puppet is not None:
            remedy = tr("Choose a take in the performer's view, so that {0} follows it.", puppet.id)
        editor.toasts.show_message(tr("{0} added {1}", path.name, ", ".join(added)), remedy)
        fresh = [name for name in editor.project.characters if name not in old_names]
        if fresh and puppet is None:
            editor.choose_all(*fresh)
        frame_path(editor)


def with_performance(project: Project, path: Path) -> tuple[Project, tuple[str, ...]]:
    """Returns the project with a recorded take added.

    Its possessed meshes become characters, and its performers become takes to retarget.

    Returns:
        The project, and the ids of everything that was added.

    Raises:
        InputError: if the file is not a recording, or nothing in it moves.
    """
    return _add_performed(project, path, _read_performance(path))


@dataclass(frozen=True)
class _RecordedTake:
    """The content of a recorded take: its possessed meshes, if any, and its performers."""

    meshes: Project | None
    clips: tuple[Clip, ...]


def _read_performance(path: Path) -> _RecordedTake:
    refused, meshes, clips = list[InputError](), None, ()
    try:
        meshes = read_possessed(path)
    except InputError as error:
        refused.append(error)
    try:
        clips = tuple(read_recorded_clips(path, whole=True))
    except InputError as error:
        refused.append(error)
    if not clips and (meshes is None or not meshes.characters):
        raise refused[0]
    return _RecordedTake(meshes, clips)


def _add_performed(project: Project, path: Path, read: _RecordedTake) -> tuple[Project, tuple[str, ...]]:
    added = list[str]()
    if read.meshes is not None:
        for name in read.meshes.characters:
            project, pasted_name = paste_character(project, read.meshes, name)
            added.append(pasted_name)
    for clip in read.clips:
        named = replace(clip, id=unused(path.stem, project.takes))
        project = project.with_takes(named)
        added.append(named.id)
    return project, tuple(added)


def _show_notes(editor: Editor, path: Path, notes: tuple[str, ...], remedy: str) -> None:
    """Shows one message with the name of the opened file and its notes."""
    if notes:
        more_note = tr(" (and {0} more)", len(notes) - 1) if len(notes) > 1 else ""
        first = (
            notes[0]
            if len(notes[0]) <= _MAX_NOTE_LETTERS
            else f"{notes[0][:_MAX_NOTE_LETTERS].rsplit(' ', 1)[0]} ..."
        )
        editor.toasts.show_message(f"{path.name}: {first}{more_note}")
    editor.toasts.show_message(tr("Opened {0}", path.name), remedy)


FILE_TYPES: tuple[FileType, ...] = (
    FileType(MODEL_SUFFIXES, lambda path: read_gltf(path, floor=True, weld=True), _add_model),
    FileType(MESH_SUFFIXES, load_mesh, _add_mesh),
    FileType(TAKE_SUFFIXES, read_take, _add_take),
    FileType(PERFORMANCE_SUFFIXES, _read_performance, _add_performance),
    FileType(SESSION_SUFFIXES, read_session, _add_session),
)
"""The file types that the studio opens without features."""


MOTIONS_FILE = Path(__file__).resolve().parent / "motions.enliven"
"""The file of the motions: a project that contains only takes."""


def read_library() -> tuple[Clip, ...]:
    """Returns every motion of the library: wave, curl, reach, walk, sway, and a quarter turn."""
    return tuple(read_project(MOTIONS_FILE).takes.values())
