"""Reads the surface of a glTF file in its bind pose. All other modules that read glTF files use this
module."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from enliven.arrays import Float, Int32, UInt8
from enliven.errors import EnlivenError
from enliven.files import DAMAGE
from enliven.meshes.gltf.bind import Bind
from enliven.meshes.gltf.file import GltfFile
from enliven.meshes.gltf.materials import Materials
from enliven.meshes.gltf.parts import GltfPart, read_parts
from enliven.meshes.mesh import Mesh

_WHITE_SRGB = np.array([255, 255, 255], np.uint8)
"""sRGB colour of parts without a colour, used if other parts have colours. glTF's default material is
white."""


@dataclass
class GltfSurface:
    """The visible surface of a file, and its bind pose.

    Attributes:
        file: the parsed file.
        parts: the primitives of the file, with values as in the file.
        bind: the bind pose of its nodes.
        rest: the vertices (V, 3) of each part in the bind pose, metres.
        mesh: all parts in one mesh, with colours and materials.
        notes: a sentence about each unusual or omitted part of the file.
    """

    file: GltfFile
    parts: list[GltfPart]
    bind: Bind
    rest: list[Float]
    mesh: Mesh
    notes: list[str]


@np.errstate(
    all="ignore"
)  # Ignore overflow warnings, because numbers of a damaged file may overflow before they are checked.
def gltf_surface(path: Path | str, name: str = "", *, still: bool = False) -> GltfSurface:
    """Reads the surface of a glTF, GLB or VRM file.

    Args:
        name: name of the mesh. If it is empty, the file's name is used.
        still: True if the surface will not be animated. Mirrored joints are then mirrored in the returned
            surface, and not only by the animation clips.

    Raises:
        InputError: if the file cannot be read, or has no visible surface.
    """
    file, notes = GltfFile(path), list[str]()
    try:
        parts, materials = read_parts(file, notes)
        if not parts:
            notes_text = f": {'; '.join(dict.fromkeys(notes))}" if notes else ""
            raise file.create_error(f"the scene of the file has no triangles{notes_text[:400]}")
        bind = Bind(file, parts, still)
        rest = [bind.vertices(part) for part in parts]
        mesh = _join_parts(name or file.path.stem, parts, rest, bind, materials)
    except EnlivenError:
        raise
    except DAMAGE as error:
        raise file.create_damage_error(error) from None
    return GltfSurface(file, parts, bind, rest, mesh, list(dict.fromkeys(notes)))


def _join_parts(
    name: str, parts: list[GltfPart], rest: list[Float], bind: Bind, materials: Materials
) -> Mesh:
    """Joins all parts into one mesh. Faces of mirrored parts are flipped."""
    vertex_starts = np.cumsum([0, *(len(v) for v in rest)])
    faces = [_turn_faces_outward(part, bind) for part in parts]
    shown = [(part_faces, part.material, part.corners) for part_faces, part in zip(faces, parts, strict=True)]
    all_faces = np.concatenate(
        [part_faces + start for part_faces, start in zip(faces, vertex_starts[:-1], strict=True)]
    )
    vertices = np.concatenate(rest)
    return Mesh(
        vertices,
        all_faces.astype(np.int32),
        name,
        _join_colours(parts),
        materials.join_materials_of_parts(shown),
    )


def _turn_faces_outward(part: GltfPart, bind: Bind) -> Int32:
    """Returns the faces (F, 3) of a part, flipped if most of their corners are mirrored."""
    used_nodes = np.unique(part.nodes[:, 0])
    mirrored = {
        int(n): bool(np.linalg.det(bind.world_from_mesh(part, int(n))[:3, :3]) < 0) for n in used_nodes
    }
    if not any(mirrored.values()):
        return part.faces
    is_mirrored = np.array([mirrored[int(n)] for n in used_nodes])[
        np.searchsorted(used_nodes, part.nodes[:, 0])
    ]
    return np.where(is_mirrored[part.faces].sum(1)[:, None] > 1, part.faces[:, ::-1], part.faces)


def _join_colours(parts: list[GltfPart]) -> UInt8 | None:
    """Returns (V, 3) sRGB colours of all parts, white for a part without colours. None if no part has
    colours.
    """
    if all(part.colours is None for part in parts):
        return None
    return np.concatenate(
        [np.tile(_WHITE_SRGB, (len(p.vertices), 1)) if p.colours is None else p.colours for p in parts]
    )
