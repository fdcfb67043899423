"""Opening models and takes from files, and writing shapes out."""

from __future__ import annotations

from pathlib import Path

from enliven.errors import InputError
from enliven.formats.bvh import read_bvh
from enliven.formats.gltf import read_gltf
from enliven.formats.gltf_write import (
    GraphPerformance,
    Performance,
    graph_performance_of,
    performance_of,
    write_gltf,
)
from enliven.motion.capture_clip import clip_of_capture
from enliven.project import Project, unused
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.possessed import with_performance

MODELS = (".glb", ".gltf")
TAKES = (".bvh",)
PERFORMANCES = (".mcap",)
_LONGEST = 130
"""Letters of a file's note that are shown."""
_BESIDE = 0.3
"""Metres between a model that is opened and what is there."""


def add_file(editor: Editor, path: Path) -> None:
    """Add a model or a take to the project.

    Raises:
        InputError: where the file cannot be read, or is of no known kind.
    """
    ending = path.suffix.lower()
    if ending in MODELS:
        _add_model(editor, path)
    elif ending in TAKES:
        _add_take(editor, path)
    elif ending in PERFORMANCES:
        _add_performance(editor, path)
    else:
        known = ", ".join((*MODELS, *TAKES, *PERFORMANCES))
        what = f"{ending} is of no known kind" if ending else "its name has no ending"
        raise InputError(what, where=str(path), mend=f"Known: {known}.")


def export(project: Project, path: Path) -> int:
    """Write every shape that has a surface and every possessed mesh, with its motion, into one GLB.

    Returns:
        How many were written.

    Raises:
        InputError: where there is none.
        ResourceError: where the file cannot be written.
    """
    solid = [shape.id for shape in project.shapes.values() if shape.mesh is not None]
    if not solid and not project.graphs:
        raise InputError("no shape has a surface", where="export", mend="Sketch one, or open a model.")
    moving: list[Performance | GraphPerformance] = [performance_of(project, name) for name in solid]
    moving += [graph_performance_of(project, name) for name in project.graphs]
    write_gltf(path, moving, path.stem)
    return len(moving)


def _add_model(editor: Editor, path: Path) -> None:
    rig = read_gltf(path, floor=True, weld=True)
    box = editor.box()

    def add(project: Project) -> Project:
        shape = rig.shape.with_changes(id=unused(rig.shape.id, project.shapes))
        if box is not None and shape.mesh is not None:
            aside = float(box[1][0] - shape.mesh.bounds[0, 0]) + _BESIDE
            shape = shape.with_changes(place=[aside, 0.0, 0.0])
        fresh = [clip for clip in rig.clips if clip.id not in project.takes]
        return project.with_shapes(shape).with_takes(*fresh)

    if editor.edit(f"open {path.name}", add):
        _tell(editor, path, rig.notes, f"{len(rig.clips)} takes came with it." if rig.clips else "")
        editor.frame_all()


def _add_take(editor: Editor, path: Path) -> None:
    capture = read_bvh(path)

    def add(project: Project) -> Project:
        return project.with_takes(clip_of_capture(capture, unused(path.stem, project.takes)))

    if editor.edit(f"open {path.name}", add):
        _tell(editor, path, capture.notes, "Map it onto a shape with M.")


def _add_performance(editor: Editor, path: Path) -> None:
    added: list[str] = []

    def add(project: Project) -> Project:
        project, names = with_performance(project, path)
        added.extend(names)
        return project

    if editor.edit(f"open {path.name}", add):
        editor.toasts.say(
            f"{path.name} brought {', '.join(added)}", "What was possessed can be cut and merged."
        )
        editor.frame_all()


def _tell(editor: Editor, path: Path, notes: tuple[str, ...], mend: str) -> None:
    """What was opened, and what was odd about it, in one message."""
    if notes:
        more = f" (and {len(notes) - 1} more)" if len(notes) > 1 else ""
        first = notes[0] if len(notes[0]) <= _LONGEST else f"{notes[0][:_LONGEST].rsplit(' ', 1)[0]} ..."
        editor.toasts.say(f"{path.name}: {first}{more}")
    editor.toasts.say(f"Opened {path.name}", mend)
