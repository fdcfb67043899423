"""Finishes a scan: cuts out the kept part, decimates it, writes it to a file, and puts it on the stage of an
edge.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Literal

import numpy as np
import typer

from enliven.arrays import Float
from enliven.errors import InputError, ResourceError
from enliven.meshes import WRITABLE, Mesh, save_mesh
from enliven.scanning import (
    CutBox,
    CutOut,
    GroundPlane,
    KnownImage,
    Scanner,
    cut_by_box,
    cut_new_object,
    decimate,
    find_focus,
    find_ground,
    find_largest_part,
    upright_frame,
)
from enliven.scanning.objects.moved_scanner import MovedScanner
from enliven_edge.scanning.person import PersonScanner, ScannedPerson

PROJECT = ".enliven"
"""File suffix of a project. A scan that is written to a project becomes a character that can be possessed."""
OUTPUT_SUFFIXES = (*WRITABLE, PROJECT)
"""File suffixes that a scan can be written to."""
_MAX_EMPTY_IMAGES = 120
"""Maximum number of images of the empty place. Images of a path around it are then 3 degrees apart."""

_NO_FLOOR_NOTE = "; no floor was found, so the box was aligned with the first image of the camera"
"""Note about a cut by a box without a detected floor. The upright direction is then unknown."""


_MOVED_OBJECT_NOTE = "the whole room, before the object was moved"
"""Note about a whole-room scan with a moved object. Only the room before the move is kept."""


@dataclass(frozen=True)
class KeptPart:
    """The part of a scan that is kept.

    Attributes:
        what: which part is kept. "thing" is the object on the floor. "alone" is the largest part, for scans
            without a visible floor. "all" is the whole scan. "box" is the content of a box. "new" is the
            parts that the first images do not show.
        low, high: (3,) metres, the corners of the box in the scan's upright frame.
        upright_from_world: (4, 4) transform to that frame; None for the frame of the finished scan.
        first_object_image: for "new": images with a smaller number show the place without the object.
    """

    what: Literal["thing", "alone", "all", "box", "new"] = "thing"
    low: Float | None = None
    high: Float | None = None
    upright_from_world: Float | None = None
    first_object_image: int = 0


@dataclass(frozen=True)
class ScannedMesh:
    """A scan as a mesh.

    Attributes:
        mesh: the upright mesh in metres, standing on y = 0.
        max_distance: maximum distance in metres between the mesh and the full scan; 0 if the mesh was not
            decimated.
        cut_note: description of the cut for users; empty if there is nothing to describe.
        person: the scanned person, if a person was scanned.
    """

    mesh: Mesh
    max_distance: float
    cut_note: str = ""
    person: ScannedPerson | None = None


def finish_scan(scanner: Scanner | MovedScanner, keep: KeptPart, triangles: int, name: str) -> ScannedMesh:
    """Returns the kept part of a scan, decimated to ``triangles`` triangles. 0 keeps all triangles.

    Raises:
        InputError: if nothing is left.
    """
    scanner.close_loops()
    person = scanner.finish_person() if isinstance(scanner, PersonScanner) else None
    mesh, note = _cut_out(scanner, keep) if person is None else (person.mesh, "")
    decimation = decimate(replace(mesh, name=name), triangles or len(mesh.faces))
    return ScannedMesh(decimation.mesh, decimation.distance_99_percentile, note, person)


def _cut_out(scanner: Scanner | MovedScanner, keep: KeptPart) -> tuple[Mesh, str]:
    """Returns the kept part with all triangles, and its description for users."""
    cut = scanner.settings.cut_out
    if keep.what == "thing":
        try:
            return scanner.extract_object(), ""
        except InputError as error:
            advice = f"{error.remedy} Or add --whole to keep the whole scan."
            raise InputError(error.what, where=error.where, remedy=advice) from None
    has_several = isinstance(scanner, MovedScanner) and len(scanner.rests) > 1
    if isinstance(scanner, MovedScanner) and keep.what == "box":
        mesh = scanner.merge_surfaces() if has_several else scanner.extract_surface()
    else:
        mesh = scanner.extract_surface(keep.first_object_image)
    if not len(mesh.faces):
        advice = "Scan for longer, and from nearer."
        raise InputError("no surface was visible in enough images", where="scan", remedy=advice)
    if keep.what == "alone":
        return find_largest_part(mesh), ""
    ground: GroundPlane | None = None
    with contextlib.suppress(InputError):  # Without a floor, keep the orientation of the first camera.
        ground = find_ground(mesh)
    if keep.what == "new":
        cut_out = cut_new_object(
            mesh, list(_empty_place_images(scanner, keep.first_object_image)), ground, cut
        )
        return cut_out.mesh, _describe_parts(cut_out, mesh, "new")
    frame = np.eye(4) if ground is None else upright_frame(ground, find_focus([p for _, p in scanner.poses]))
    if keep.what == "box" and keep.low is not None and keep.high is not None:
        own_frame = frame if keep.upright_from_world is None else keep.upright_from_world
        cut_out = cut_by_box(mesh, CutBox(keep.low, keep.high, own_frame), cut)
        floor_note = "" if ground or keep.upright_from_world is not None else _NO_FLOOR_NOTE
        return cut_out.mesh, _describe_parts(cut_out, mesh, "in the box") + floor_note
    note = _MOVED_OBJECT_NOTE if has_several else ""
    return replace(mesh, vertices=mesh.vertices @ frame[:3, :3].T + frame[:3, 3]), note


def _describe_parts(out: CutOut, whole_mesh: Mesh, where: str) -> str:
    """Returns a description for users of the part that was cut out."""
    parts = "1 part" if out.parts == 1 else f"{out.parts} parts"
    return f"{where}: {parts}, {out.area:.2f} of {whole_mesh.area:.2f} square metres"


def _empty_place_images(scanner: Scanner | MovedScanner, first_object_image: int) -> Iterator[KnownImage]:
    """Yields images of the empty place, at most :data:`_MAX_EMPTY_IMAGES`."""
    numbers = [number for number in scanner.history.numbers if number < first_object_image]
    chosen_numbers = numbers[:: max(len(numbers) // _MAX_EMPTY_IMAGES, 1)]
    for number, frame in scanner.history.frames(chosen_numbers):
        depth = np.asarray(frame.depth, np.float32)
        yield KnownImage(depth, frame.intrinsics, scanner.poses[number][1])


def write_scan(scan_result: ScannedMesh, path: Path) -> None:
    """Writes a scan as a mesh, or as a project with one character.

    Falls back to another folder if that fails.

    Raises:
        ResourceError: if the path cannot be written. The message names the folder that was used instead.
    """
    try:
        _write(scan_result, path)
    except ResourceError as error:
        fallback = _write_elsewhere(scan_result, path)
        if fallback is None:
            raise
        problem, remedy = (
            f"{error.what}, so the scan was saved as {fallback}",
            "Free some disk space, and then move the saved file.",
        )
        raise ResourceError(problem, where=str(path), remedy=remedy) from None


def _write_elsewhere(scan_result: ScannedMesh, path: Path) -> Path | None:
    """Writes a mesh into a folder on another disk. Returns the file, or None if no folder can be written."""
    for folder in (Path.home(), Path(tempfile.gettempdir())):
        fallback = folder / f"{path.stem}.saved{path.suffix}"
        with contextlib.suppress(ResourceError):
            _write(scan_result, fallback)
            return fallback
    return None


def _write(scan_result: ScannedMesh, path: Path) -> None:
    if path.suffix.lower() != PROJECT:
        save_mesh(scan_result.mesh, path)
        return
    from enliven.formats.project.file import write_project
    from enliven.formats.project.one_character import project_of_mesh

    project = project_of_mesh(scan_result.mesh, path.stem)
    if scan_result.person is not None:
        # Store the known end points and joints. Then each limb of the performer drives the same limb of the
        # mesh, and no person needs to be detected in the mesh.
        (character,) = project.characters.values()
        character_with_joints = character.with_changes(
            ends=scan_result.person.ends, joints=scan_result.person.bones
        )
        project = project.with_characters(character_with_joints)
    write_project(path, project)


def stage_command() -> EntryPoint:
    """Returns the command that puts characters on the stage of a running edge.

    Raises:
        ResourceError: if the viewer, which contains the command, is not installed.
    """
    entries = list(entry_points(group="enliven.commands", name="stage"))
    if not entries:
        remedy = (
            "Install the package enliven-viewer, or put the mesh on the stage from a computer with the "
            "viewer."
        )
        raise ResourceError("the viewer is not installed here", where="--edge", remedy=remedy)
    return entries[0]


def put_on_stage(path: Path, edge: str) -> None:
    """Puts a written scan on the stage of a running edge, as ``enliven stage put`` does.

    Raises:
        EnlivenError: if no edge answers, or the edge refuses.
    """
    command = typer.main.get_command(stage_command().load())
    command.main(["put", str(path), "--edge", edge], standalone_mode=False)
