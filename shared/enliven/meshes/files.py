"""Reads and writes mesh files. Any error in a damaged file raises InputError with a message for the user."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from enliven.errors import InputError, find_plain_reason
from enliven.files import ReferencedFiles, is_file, read_file, require_folder, write_file
from enliven.meshes.gltf.gltf_json import GLTF_SUFFIXES
from enliven.meshes.mesh import Axis, Mesh, guess_up, rotate_upright, weld
from enliven.meshes.obj import read_obj
from enliven.meshes.ply import read_ply
from enliven.meshes.repair import SAME_POSITION, repair
from enliven.meshes.scan_surface import parse_pcd, surface_through_points
from enliven.meshes.stl import read_stl
from enliven.meshes.text import read_medit, read_off
from enliven.meshes.tokens import DamagedMeshError

READABLE = (".obj", ".off", ".ply", ".stl", *GLTF_SUFFIXES, ".mesh", ".pcd")
WRITABLE = (".obj", ".off", ".ply", ".stl", ".glb")
_MAX_REASON_LETTERS = 200
"""Maximum number of characters of a reader's own message that an error message includes."""
_TABLE_READERS = {".off": read_off, ".mesh": read_medit, ".stl": read_stl}
"""Readers of formats that contain vertices and faces only."""


class LoadedMesh(NamedTuple):
    """A repaired mesh, and notes: one sentence for each repair and each unusual property."""

    mesh: Mesh
    notes: list[str]


def load_mesh(path: Path | str) -> LoadedMesh:
    """Reads a mesh in the file's own units. Scenes are flattened, polygons become triangles.

    A rigged glTF is read in its rest pose. Nothing is scaled: see :func:`enliven.meshes.mesh.fit_height`.

    Raises:
        InputError: if the file is missing, empty, truncated, of another format, has no usable faces, or
            refers to files outside its folder.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    known_formats = f"Known mesh formats: {', '.join(s[1:] for s in READABLE)}."
    if suffix not in READABLE and is_file(path):
        raise InputError(
            f"{suffix or 'a file without an extension'} is not a known mesh format",
            where=str(path),
            remedy=known_formats,
        )
    mesh, read_notes = _read_unrepaired(path, suffix, known_formats)
    try:
        mesh, notes = repair(mesh)
        notes = [*read_notes, *notes]
    except InputError as error:
        raise InputError(error.what, where=str(path), remedy=error.remedy) from None
    if suffix == ".stl":
        # STL never shares vertices between faces, so duplicate positions are not shading seams. Weld them.
        welded, _ = weld(mesh)
        notes = [note for note in notes if SAME_POSITION not in note]
        notes.append(
            f"{len(mesh.vertices)} triangle corners of the STL file were welded to "
            f"{len(welded.vertices)} vertices"
        )
        mesh = welded
    return LoadedMesh(mesh, notes)


def load_upright(path: Path | str, up: Axis | None = None) -> LoadedMesh:
    """Reads a mesh as :func:`load_mesh` does, and turns it upright.

    Args:
        up: the axis of the mesh that points up. If None, the axis is guessed, except for glTF, which always
            has +Y up.
    """
    mesh, notes = load_mesh(path)
    if up is None and Path(path).suffix.lower() not in GLTF_SUFFIXES:
        up, note = guess_up(mesh)
        notes = [*notes, note] if note else notes
    return LoadedMesh(rotate_upright(mesh, up or "y"), notes)


def _read_unrepaired(path: Path, suffix: str, known: str) -> tuple[Mesh, list[str]]:
    """Returns the mesh without repairs, and notes of its reader.

    Args:
        known: the sentence that lists the known formats, for errors.
    """
    if suffix in GLTF_SUFFIXES:
        # Imported here, because it loads the image library, which only glTF files need.
        from enliven.meshes.gltf.surface import gltf_surface

        surface = gltf_surface(path, still=True)
        return surface.mesh, surface.notes
    data = read_file(path)
    if not data:
        raise InputError("the file is empty", where=str(path), remedy="Export the mesh again.")
    try:
        return _read_format(path, suffix, data)
    except InputError as error:
        raise InputError(error.what, where=str(path), remedy="Export the mesh again.") from None
    except Exception as error:  # Third-party readers may raise any exception for damaged data.
        # Show only messages that were written for users.
        reason = (
            str(error)
            if isinstance(error, DamagedMeshError)
            else find_plain_reason(error, "the file is damaged")
        )
        problem = f"the file cannot be read as {suffix[1:]}: {reason[:_MAX_REASON_LETTERS]}"
        raise InputError(
            problem,
            where=str(path),
            remedy="Check that the file is complete and has the correct file extension. " + known,
        ) from None


def _read_format(path: Path, suffix: str, data: bytes) -> tuple[Mesh, list[str]]:
    """Returns the mesh without repairs, and notes of its reader."""
    if suffix in _TABLE_READERS:
        vertices, faces, notes = _TABLE_READERS[suffix](data)
        return Mesh(vertices, faces, path.stem), notes
    if suffix == ".obj":
        return read_obj(data, ReferencedFiles(path), path.stem)
    if suffix == ".ply":
        return read_ply(data, path.stem)
    return surface_through_points(*parse_pcd(data, str(path)), name=path.stem), []


def save_mesh(mesh: Mesh, path: Path | str) -> None:
    """Writes a mesh as obj, off, ply, stl or glb, depending on the path's suffix. The file is written
    completely or not at all.

    Raises:
        InputError: if the suffix is unknown.
        ResourceError: if the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in WRITABLE:
        known_formats = ", ".join(s[1:] for s in WRITABLE)
        raise InputError(
            f"meshes cannot be written to {path.suffix or 'extensionless'} files",
            where=str(path),
            remedy=f"Known formats: {known_formats}.",
        )
    require_folder(path)
    kind = path.suffix.lower()[1:]
    if kind == "glb":
        from enliven.meshes.gltf.scene import (
            mesh_glb,  # Imported here, because only glTF files need pygltflib.
        )

        write_file(path, mesh_glb(mesh))
        return
    # Imported here, because only the other formats need trimesh.
    from enliven.meshes.scenes import scene_bytes

    write_file(path, scene_bytes(mesh, kind))
