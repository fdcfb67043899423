"""What becomes of a scan: cut out or whole, of few triangles, in a file, and on the stage of an edge."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

import typer

from enliven.errors import InputError, ResourceError
from enliven.meshes import WRITABLE, save_mesh
from enliven.scanning import Decimated, Scanner, decimated, find_ground, levelled

PROJECT = ".enliven"
"""Ending of a project; the scan is a character in it that can be possessed."""
ENDINGS = (*WRITABLE, PROJECT)
"""Endings of the files that a scan is written to."""


def finished(scanner: Scanner, whole: bool, triangles: int, name: str) -> Decimated:
    """Returns what was scanned, of at most so many triangles; 0 keeps all.

    Args:
        whole: keeps all that was scanned, level where a floor was, and not what stands on the floor.

    Raises:
        InputError: where there is nothing.
    """
    if whole:
        mesh = scanner.surface()
        if not len(mesh.faces):
            mend = "Scan for longer, and nearer."
            raise InputError("no surface was seen often enough", where="scan", mend=mend)
        with contextlib.suppress(InputError):  # Without a floor it lies as the first camera saw it.
            mesh = levelled(mesh, find_ground(mesh, settings=scanner.settings.cut_out))
    else:
        try:
            mesh = scanner.thing()
        except InputError as error:
            mend = f"{error.mend} Or add --whole to keep all that was scanned."
            raise InputError(error.what, where=error.where, mend=mend) from None
    return decimated(replace(mesh, name=name), triangles or len(mesh.faces))


def write_scan(made: Decimated, path: Path) -> None:
    """Writes a scan as a mesh, or as a project of one character.

    Raises:
        ResourceError: where it cannot be written.
    """
    if path.suffix.lower() != PROJECT:
        save_mesh(made.mesh, path)
        return
    from enliven.formats.project import project_of_mesh, write_project

    write_project(path, project_of_mesh(made.mesh, path.stem))


def stage_command() -> EntryPoint:
    """Returns the command that puts characters on the stage of a running edge.

    Raises:
        ResourceError: where the viewer, which brings it, is not installed.
    """
    found = list(entry_points(group="enliven.commands", name="stage"))
    if not found:
        mend = "Install the viewer's package, or put the mesh there from the viewer's machine."
        raise ResourceError("the viewer is not installed here", where="--edge", mend=mend)
    return found[0]


def put_on_stage(path: Path, edge: str) -> None:
    """Puts a written scan on the stage of a running edge, as ``enliven stage put`` does.

    Raises:
        EnlivenError: where no edge answers, or it refuses.
    """
    command = typer.main.get_command(stage_command().load())
    command.main(["put", str(path), "--edge", edge], standalone_mode=False)
