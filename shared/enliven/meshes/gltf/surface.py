"""The surface of a glTF file in its bind pose: what every reader of such a file begins with."""

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
from enliven.meshes.gltf.parts import GltfPart, parts_of
from enliven.meshes.mesh import Mesh

_WHITE = np.array([255, 255, 255], np.uint8)
"""sRGB of a part without a colour next to parts that have one: glTF's default material is white."""


@dataclass
class GltfSurface:
    """What a file shows, and where it stands in the bind pose.

    Attributes:
        file: the parsed file.
        parts: its primitives, as the file has them.
        bind: the bind pose of its nodes.
        rest: the vertices (V, 3) of each part in the bind pose, metres.
        mesh: all parts in one mesh, with colours and materials.
        notes: what was unusual or left out, a sentence each.
    """

    file: GltfFile
    parts: list[GltfPart]
    bind: Bind
    rest: list[Float]
    mesh: Mesh
    notes: list[str]


@np.errstate(all="ignore")  # numbers of a damaged file overflow on their way to the checks
def gltf_surface(path: Path | str, name: str = "", *, still: bool = False) -> GltfSurface:
    """Reads the surface of a glTF, GLB or VRM file.

    Args:
        name: of the mesh; the file's name if empty.
        still: the surface is not to move: mirrored joints are mirrored in it, and not only by the clips.

    Raises:
        InputError: where the file cannot be read, or has nothing to draw.
    """
    file, notes = GltfFile(path), list[str]()
    try:
        parts, materials = parts_of(file, notes)
        if not parts:
            left = f": {'; '.join(dict.fromkeys(notes))}" if notes else ""
            raise file.wrong(f"there is no triangle in its scene{left[:400]}")
        bind = Bind(file, parts, still)
        rest = [bind.vertices(part) for part in parts]
        mesh = _mesh(name or file.path.stem, parts, rest, bind, materials)
    except EnlivenError:
        raise
    except DAMAGE as error:
        raise file.damaged(error) from None
    return GltfSurface(file, parts, bind, rest, mesh, list(dict.fromkeys(notes)))


def _mesh(name: str, parts: list[GltfPart], rest: list[Float], bind: Bind, materials: Materials) -> Mesh:
    """Joins all parts into one mesh; faces of mirrored places are turned round."""
    first = np.cumsum([0, *(len(v) for v in rest)])
    faces = [_outward(part, bind) for part in parts]
    shown = [(own, part.material, part.corners) for own, part in zip(faces, parts, strict=True)]
    whole = np.concatenate([own + start for own, start in zip(faces, first[:-1], strict=True)])
    vertices = np.concatenate(rest)
    return Mesh(vertices, whole.astype(np.int32), name, _colours(parts), materials.joined(shown))


def _outward(part: GltfPart, bind: Bind) -> Int32:
    """(F, 3) the faces of a part, turned round where most of their corners are mirrored."""
    own = np.unique(part.nodes[:, 0])
    mirrored = {int(n): bool(np.linalg.det(bind.world_from_mesh(part, int(n))[:3, :3]) < 0) for n in own}
    if not any(mirrored.values()):
        return part.faces
    over = np.array([mirrored[int(n)] for n in own])[np.searchsorted(own, part.nodes[:, 0])]
    return np.where(over[part.faces].sum(1)[:, None] > 1, part.faces[:, ::-1], part.faces)


def _colours(parts: list[GltfPart]) -> UInt8 | None:
    """(V, 3) sRGB of all parts, white where a part has none; None where no part has any."""
    if all(part.colours is None for part in parts):
        return None
    return np.concatenate(
        [np.tile(_WHITE, (len(p.vertices), 1)) if p.colours is None else p.colours for p in parts]
    )
