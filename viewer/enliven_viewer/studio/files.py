"""Opening and saving: models, takes and projects from files, into an editor."""

from __future__ import annotations

from pathlib import Path

from enliven.errors import InputError
from enliven.formats.gltf import read_gltf
from enliven.project import Project, unused
from enliven_viewer.studio.editor import Editor

MODELS = (".glb", ".gltf")
TAKES = (".bvh",)
PROJECT = ".enliven"
_BESIDE = 0.3
"""Metres between a model that is opened and what is there."""


def open_file(editor: Editor, path: Path) -> None:
    """Add a model or a take to the project, or open another project.

    Raises:
        InputError: where the file cannot be read, or is of no known kind.
    """
    ending = path.suffix.lower()
    if ending in MODELS:
        _add_model(editor, path)
    else:
        known = ", ".join((*MODELS, *TAKES, PROJECT))
        raise InputError(
            f"{ending or 'no ending'} is of no known kind", where=str(path), mend=f"Known: {known}."
        )


def _add_model(editor: Editor, path: Path) -> None:
    rig = read_gltf(path, floor=True, weld=True)

    def add(project: Project) -> Project:
        shape = rig.shape.with_changes(id=unused(rig.shape.id, project.shapes))
        box = editor.box()
        if box is not None and shape.mesh is not None:
            shape = shape.with_changes(place=[float(box[1][0] - shape.mesh.bounds[0, 0]) + _BESIDE, 0.0, 0.0])
        fresh = [c for c in rig.clips if c.id not in project.takes]
        return project.with_shapes(shape).with_takes(*fresh)

    if editor.edit(f"open {path.name}", add):
        for note in rig.notes:
            editor.toasts.say(f"{path.name}: {note}")
        editor.toasts.say(
            f"Opened {path.name}", f"{len(rig.clips)} animations came with it." * bool(rig.clips)
        )
