"""What becomes of a scan: cut out or whole, of few triangles, in a file, and on the stage of an edge."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Literal

import typer

from enliven.errors import InputError, ResourceError
from enliven.meshes import WRITABLE, save_mesh
from enliven.scanning import Decimated, Scanner, decimated, find_ground, largest_part, levelled
from enliven.scanning.objects import MovedScanner

PROJECT = ".enliven"
"""Ending of a project; the scan is a character in it that can be possessed."""
ENDINGS = (*WRITABLE, PROJECT)
"""Endings of the files that a scan is written to."""


Kept = Literal["thing", "alone", "all"]
"""What is kept of a scan: what stands on the floor; the largest part, of which no floor was seen; or all."""


def finished(scanner: Scanner | MovedScanner, kept: Kept, triangles: int, name: str) -> Decimated:
    """Returns what was scanned, on y = 0, of at most so many triangles; 0 keeps all.

    Raises:
        InputError: where there is nothing.
    """
    scanner.close_loops()
    if kept != "thing":
        mesh = scanner.surface()
        if not len(mesh.faces):
            mend = "Scan for longer, and nearer."
            raise InputError("no surface was seen often enough", where="scan", mend=mend)
    if kept == "alone":
        mesh = largest_part(mesh)
    elif kept == "all":
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
