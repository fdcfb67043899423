"""Meshes in and out of files; whatever is wrong with a file becomes one clear message."""

from __future__ import annotations

import logging
import warnings
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh

from enliven.arrays import Float, UInt8
from enliven.errors import InputError, ResourceError
from enliven.files import Beside, read_file
from enliven.meshes.gltf_json import gltf_tree
from enliven.meshes.heads import check_obj, check_ply
from enliven.meshes.mesh import Mesh, weld
from enliven.meshes.repair import repair
from enliven.meshes.scan_surface import parse_pcd, surface_through
from enliven.meshes.stl import read_stl
from enliven.meshes.text import read_medit, read_off

READABLE = (".obj", ".off", ".ply", ".stl", ".glb", ".gltf", ".mesh", ".pcd")
WRITABLE = (".obj", ".off", ".ply", ".stl", ".glb")
_OWN_READERS = {".off": read_off, ".mesh": read_medit, ".stl": read_stl}


class LoadedMesh(NamedTuple):
    """A mesh that can be used, and one sentence for each thing that was repaired or is unusual."""

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
    data = read_file(path)
    if not data:
        raise InputError("the file is empty", where=str(path), mend="Export the mesh again.")
    try:
        mesh = _read(path, suffix, data)
    except InputError as error:
        raise InputError(error.what, where=str(path), mend="Export the mesh again.") from None
    except Exception as error:  # the readers of foreign bytes raise whatever they like
        reason = str(error).strip().splitlines()
        what = f"it cannot be read as {suffix[1:]}: {reason[0][:200] if reason else type(error).__name__}"
        raise InputError(
            what, where=str(path), mend="Is it whole, and of the kind it says? " + known
        ) from None
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
    return LoadedMesh(mesh, notes)


def _read(path: Path, suffix: str, data: bytes) -> Mesh:
    """The mesh as the file has it, unrepaired."""
    if suffix in _OWN_READERS:
        vertices, faces = _OWN_READERS[suffix](data)
        return Mesh(vertices, faces, path.stem)
    if suffix == ".pcd":
        return surface_through(*parse_pcd(data, str(path)), name=path.stem)
    if suffix in (".glb", ".gltf"):
        gltf_tree(data)
    elif suffix == ".ply":
        check_ply(data)
    elif suffix == ".obj":
        check_obj(data)
    log = logging.getLogger("trimesh")
    level, log.level = log.level, logging.CRITICAL
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            beside = _Named(Beside(path), uris=suffix in (".glb", ".gltf"))
            scene = trimesh.load_scene(BytesIO(data), file_type=suffix[1:], resolver=beside, process=False)
    finally:
        log.setLevel(level)
    return _flattened(scene, path.stem)


class _Named(trimesh.resolvers.Resolver):  # type: ignore[misc]
    """The files that a mesh names, for the library that reads it; ``uris`` says that names are URIs."""

    def __init__(self, beside: Beside, uris: bool) -> None:
        self._beside, self._uris = beside, uris

    def get(self, key: str) -> bytes:
        return self._beside.uri(key) if self._uris else self._beside.file(key.strip())

    def keys(self) -> list[str]:
        return []

    def write(self, name: str, data: Any) -> None:
        raise NotImplementedError("a reader writes nothing")

    def namespaced(self, namespace: str) -> _Named:
        return self


def _flattened(scene: Any, name: str) -> Mesh:
    """All triangles of a scene in one mesh, each placed by its node's transform."""
    vertices: list[Any] = []
    faces: list[Any] = []
    colours: list[UInt8 | None] = []
    count = 0
    for node in scene.graph.nodes_geometry:
        world_from_node, key = scene.graph[node]
        part = scene.geometry[key]
        if not isinstance(part, trimesh.Trimesh) or len(part.faces) == 0:
            continue
        turned = bool(np.linalg.det(world_from_node[:3, :3]) < 0)
        faces.append(part.faces[:, ::-1] + count if turned else part.faces + count)
        vertices.append(part.vertices @ world_from_node[:3, :3].T + world_from_node[:3, 3])
        colours.append(_colours(part))
        count += len(part.vertices)
    if not faces:
        raise InputError("it has no faces")
    return Mesh(np.concatenate(vertices), np.concatenate(faces), name, _joined(colours, vertices))


def _joined(colours: list[UInt8 | None], vertices: list[Any]) -> UInt8 | None:
    """One colour array for all parts, light grey where a part has none; None where no part has any."""
    if all(c is None for c in colours):
        return None
    grey = np.array([200, 200, 200], np.uint8)
    parts = zip(colours, vertices, strict=True)
    return np.concatenate([np.tile(grey, (len(v), 1)) if c is None else c for c, v in parts])


def _colours(part: Any) -> UInt8 | None:
    """(V, 3) the vertex colours of a part, or its material's one colour, or None."""
    visual = part.visual
    if visual.kind == "vertex":
        return np.asarray(visual.vertex_colors[:, :3], np.uint8)
    colour = getattr(getattr(visual, "material", None), "main_color", None)
    if visual.kind != "texture" or colour is None or np.shape(colour) != (4,):
        return None
    shown = np.asarray(colour[:3], np.uint8)
    if isinstance(visual.material, trimesh.visual.material.PBRMaterial):
        shown = _srgb(shown / 255.0)
    return np.tile(shown, (len(part.vertices), 1))


def _srgb(linear: Float) -> UInt8:
    """sRGB bytes of linear light in [0, 1], which is what glTF's colour factors are (IEC 61966-2-1)."""
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(255 * curve), np.uint8)


def save_mesh(mesh: Mesh, path: Path | str) -> None:
    """Write a mesh as obj, off, ply, stl or glb, by the path's ending.

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
    colours = None if mesh.colours is None else mesh.colours
    out = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=colours, process=False)
    data = out.export(file_type=path.suffix.lower()[1:])
    try:
        path.write_bytes(data if isinstance(data, bytes) else str(data).encode())
    except OSError as error:
        raise ResourceError(f"cannot write ({error.strerror})", where=str(path)) from None
