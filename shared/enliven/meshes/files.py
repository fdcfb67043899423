"""Reads and writes mesh files; an error in a file becomes one clear message."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from enliven.errors import InputError, plain_reason
from enliven.files import need_folder, read_file, write_file
from enliven.meshes.gltf import GLTF_SUFFIXES
from enliven.meshes.heads import check_obj, check_ply
from enliven.meshes.mesh import Axis, Mesh, guess_up, upright, weld
from enliven.meshes.repair import repair
from enliven.meshes.scan_surface import parse_pcd, surface_through
from enliven.meshes.stl import read_stl
from enliven.meshes.text import read_medit, read_off

READABLE = (".obj", ".off", ".ply", ".stl", *GLTF_SUFFIXES, ".mesh", ".pcd")
WRITABLE = (".obj", ".off", ".ply", ".stl", ".glb")
_OF_PYTHON = re.compile(
    r"could not convert|invalid literal|cannot (reshape|convert|copy)|not enough values|too many values"
    r"|buffer|array|operands|all (the )?input|string|setting an array|shape|need at least|negative|embedded"
)
"""How the messages of Python and NumPy begin, which say nothing to a user."""
_OWN_READERS = {".off": read_off, ".mesh": read_medit, ".stl": read_stl}


class LoadedMesh(NamedTuple):
    """A usable mesh, and one sentence for each repair and each unusual property."""

    mesh: Mesh
    notes: list[str]


def load_mesh(path: Path | str) -> LoadedMesh:
    """Read a mesh in the file's own units; scenes are flattened, polygons become triangles.

    A rigged glTF is read in its rest pose. Nothing is scaled: see :func:`enliven.meshes.mesh.fit_height`.

    Raises:
        InputError: for a missing, empty, truncated or foreign file, one without usable faces, or one that
            names files outside of its folder.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    known = f"Known formats: {', '.join(s[1:] for s in READABLE)}."
    if suffix not in READABLE and path.is_file():
        raise InputError(
            f"{suffix or 'a file without an ending'} is no known mesh", where=str(path), mend=known
        )
    told = list[str]()
    if suffix in GLTF_SUFFIXES:
        from enliven.meshes.gltf import gltf_surface  # loads the reader of pictures, which only files need

        surface = gltf_surface(path)
        mesh, told = surface.mesh, surface.notes
    else:
        mesh = _unrepaired(path, suffix, known)
    try:
        mesh, notes = repair(mesh)
    except InputError as error:
        raise InputError(error.what, where=str(path), mend=error.mend) from None
    if suffix == ".stl":
        # STL has no shared vertices at all, so its cuts say nothing about shading.
        welded, _ = weld(mesh)
        notes = [note for note in notes if "repeat a position" not in note]
        notes.append(f"welded {len(mesh.vertices)} STL corners to {len(welded.vertices)} vertices")
        mesh = welded
    return LoadedMesh(mesh, [*told, *notes])


def load_upright(path: Path | str, up: Axis | None = None) -> LoadedMesh:
    """Reads a mesh as :func:`load_mesh` does, and turns it upright.

    Args:
        up: its own axis that points up; None guesses it, except for a glTF, which has +Y up.
    """
    mesh, notes = load_mesh(path)
    if up is None and Path(path).suffix.lower() not in GLTF_SUFFIXES:
        up, note = guess_up(mesh)
        notes = [*notes, note] if note else notes
    return LoadedMesh(upright(mesh, up or "y"), notes)


def _unrepaired(path: Path, suffix: str, known: str) -> Mesh:
    """The mesh of a file other than glTF; ``known`` says in errors which kinds there are."""
    data = read_file(path)
    if not data:
        raise InputError("the file is empty", where=str(path), mend="Export the mesh again.")
    try:
        return _read(path, suffix, data)
    except InputError as error:
        raise InputError(error.what, where=str(path), mend="Export the mesh again.") from None
    except Exception as error:  # the readers of foreign bytes raise whatever they like
        # The readers of this room say what is wrong in a ValueError; Python and NumPy use it too.
        said = str(error).strip().partition("\n")[0][:200]
        own = type(error) is ValueError and said and not _OF_PYTHON.match(said)
        what = f"it cannot be read as {suffix[1:]}: {said if own else plain_reason(error)}"
        raise InputError(
            what, where=str(path), mend="Is it whole, and of the kind it says? " + known
        ) from None


def _read(path: Path, suffix: str, data: bytes) -> Mesh:
    """The mesh as the file has it, unrepaired."""
    if suffix in _OWN_READERS:
        vertices, faces = _OWN_READERS[suffix](data)
        return Mesh(vertices, faces, path.stem)
    if suffix == ".pcd":
        return surface_through(*parse_pcd(data, str(path)), name=path.stem)
    if suffix == ".ply":
        check_ply(data)
    elif suffix == ".obj":
        check_obj(data)
    from enliven.meshes.scenes import read_scene  # loads trimesh, which only files need

    return read_scene(data, path)


def save_mesh(mesh: Mesh, path: Path | str) -> None:
    """Write a mesh as obj, off, ply, stl or glb, by the path's ending, whole or not at all.

    Raises:
        InputError: for an unknown ending.
        ResourceError: where the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in WRITABLE:
        known = ", ".join(s[1:] for s in WRITABLE)
        raise InputError(
            f"cannot write {path.suffix or 'no'} files", where=str(path), mend=f"Known: {known}."
        )
    need_folder(path)
    kind = path.suffix.lower()[1:]
    if kind == "glb":
        from enliven.meshes.gltf import mesh_glb  # loads pygltflib, which only files need

        write_file(path, mesh_glb(mesh))
        return
    from enliven.meshes.scenes import scene_bytes  # loads trimesh, which only files need

    write_file(path, scene_bytes(mesh, kind))
