"""Writes each frame as a Wavefront OBJ file, in a folder with a shared material file and its images.

walk.obj-sequence/walk_0001.obj, walk_0002.obj, ..., walk.mtl, walk_texture_1.png

The surface of every frame is exact for all rigs, because the files contain vertex positions and no bones. All
files have the same vertices and faces in the same order. A comment at the top of each file contains its time.
A character keeps its last pose if its motion ends early.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from enliven.arrays import Float, Float32, Int
from enliven.errors import InputError
from enliven.exporters.performance import Performance
from enliven.exporters.placement import PLACEMENTS, units_per_metre
from enliven.exporters.plain_materials import PlainMaterial, image_suffix, make_plain_materials
from enliven.exporters.registry import Exporter
from enliven.files import replace_folder
from enliven.meshes import Mesh

_OWN_FILE = re.compile(r".+(_\d{4,}\.obj|\.mtl|_texture_\d+\.(png|jpg))", re.DOTALL)
"""Pattern of the file names in a folder of this format. A folder that contains other files is not
replaced."""


@dataclass(frozen=True)
class _Part:
    """The text of a character that is the same in every file.

    Attributes:
        head: the lines before the vertices.
        colours: (V,) text of each vertex's colour, which follows its position. Empty without vertex colours.
        tail: the lines after the vertices.
        count: number of vertices.
    """

    head: str
    colours: list[str]
    tail: str
    count: int


def write_obj_sequence(
    path: Path | str,
    performances: Sequence[Performance],
    name: str = "enliven",
    unit: str = "m",
    progress: Callable[[float], object] | None = None,
) -> None:
    """Writes a folder with one OBJ file for each frame.

    Args:
        name: the title, for the comment in each file.
        unit: unit of positions, "m" or "cm".
        progress: called with the finished fraction. An exception that it raises ends the export.

    Raises:
        InputError: if no character is given, a character has no mesh, the unit is unknown, or an existing
            folder contains other files.
        ResourceError: if the folder cannot be written. An existing folder then stays unchanged.
    """
    path, scale = Path(path), units_per_metre(unit)
    if not performances:
        raise InputError(
            "no character was selected", where=str(path), remedy="Select at least one character."
        )
    # Many readers use only the part of a file name before the first space.
    stem, title = "_".join(path.stem.split()), " ".join(name.split())
    times = max((performance.times for performance in performances), key=len)
    count = len(times)
    materials = _MaterialFile(stem)
    parts, vertex_count, corners = list[_Part](), 0, 0
    for performance in performances:
        mesh = performance.surface[0]
        part, coordinates = _part_from_character(performance.name, mesh, vertex_count, corners, materials)
        parts.append(part)
        vertex_count, corners = vertex_count + part.count, corners + coordinates
    library = f"mtllib {stem}.mtl\n" if materials.lines else ""
    with replace_folder(path, _is_own_file, "Choose another output folder.") as folder:
        materials.write_into(folder)
        surfaces = [_surfaces_at(performance, times) for performance in performances]
        for number, time in enumerate(times, 1):
            text = [f"# {title}: frame {number} of {count}, {time:.6f} s, unit {unit}\n", library]
            for part, surface in zip(parts, surfaces, strict=True):
                text += [part.head, _vertex_lines(next(surface) * np.float32(scale), part.colours), part.tail]
            (folder / f"{stem}_{number:04d}.obj").write_text("".join(text), "utf-8")
            if progress is not None:
                progress(number / count)


OBJ_SEQUENCE = Exporter(
    write_obj_sequence,
    pointwise=True,
    placements=PLACEMENTS,
    check=lambda unit="m", **_: units_per_metre(unit),
)


def _is_own_file(name: str) -> bool:
    return _OWN_FILE.fullmatch(name) is not None


def _surfaces_at(performance: Performance, times: Float) -> Iterator[Float32]:
    """Yields the surface (V, 3) at each time. It is the surface of the nearest frame, or the last surface
    after the end.
    """
    own_times = performance.times
    boundaries = (own_times[1:] + own_times[:-1]) / 2.0
    surfaces = performance.surfaces()
    surface, surface_number = next(surfaces), 0
    for nearest in np.searchsorted(boundaries, times):
        for _ in range(surface_number, nearest):
            surface = next(surfaces)
        surface_number = int(nearest)
        yield surface


def _vertex_lines(vertices: Float32, colours: list[str]) -> str:
    """Returns a line for each vertex, with its colour if there are colours."""
    if colours:
        rows = zip(vertices.tolist(), colours, strict=True)
        return "".join(f"v {x:.6f} {y:.6f} {z:.6f}{colour}\n" for (x, y, z), colour in rows)
    return ("v %.6f %.6f %.6f\n" * len(vertices)) % tuple(vertices.ravel().tolist())


def _part_from_character(
    name: str, mesh: Mesh, vertex_offset: int, corner_offset: int, materials: _MaterialFile
) -> tuple[_Part, int]:
    """Returns the constant text of a character, and its number of texture coordinates.

    Args:
        vertex_offset, corner_offset: number of vertices and of texture coordinates of the previous characters
            in the same file.
    """
    colours, mesh_materials = list[str](), mesh.materials
    if mesh.colours is not None:
        colours = [f" {r:.4f} {g:.4f} {b:.4f}" for r, g, b in (mesh.colours / 255.0).tolist()]
    faces = mesh.faces.astype(np.int64) + vertex_offset + 1
    head = f"o {'_'.join(name.split()) or 'character'}\n"
    if mesh_materials is None:
        return _Part(head, colours, "s 1\n" + _face_lines(faces, None), len(mesh.vertices)), 0
    names = materials.add(mesh)
    has_coordinates = mesh_materials.uvs.shape[2] > 0
    lines, numbers, count = list[str](), None, 0
    if has_coordinates:
        # OBJ counts texture rows from the bottom of the image, glTF from its top.
        flat = mesh_materials.uvs[:, :, 0].reshape(-1, 2) * [1.0, -1.0] + [0.0, 1.0]
        unique, of = np.unique(flat, axis=0, return_inverse=True)
        numbers, count = of.reshape(-1, 3) + corner_offset + 1, len(unique)
        lines.append(("vt %.6f %.6f\n" * count) % tuple(unique.ravel().tolist()))
    lines.append("s 1\n")
    for number in np.unique(mesh_materials.of):
        part_faces = mesh_materials.of == number
        lines.append(f"usemtl {names[number] if number >= 0 else materials.add_plain_material()}\n")
        lines.append(_face_lines(faces[part_faces], None if numbers is None else numbers[part_faces]))
    return _Part(head, colours, "".join(lines), len(mesh.vertices)), count


def _face_lines(faces: Int, coordinates: Int | None) -> str:
    if coordinates is None:
        return ("f %d %d %d\n" * len(faces)) % tuple(faces.ravel().tolist())
    corner_indices = np.stack([faces, coordinates], 2)
    return ("f %d/%d %d/%d %d/%d\n" * len(faces)) % tuple(corner_indices.ravel().tolist())


class _MaterialFile:
    """The material file of a sequence, with the images that it refers to.

    Attributes:
        lines: the text of the file.
    """

    def __init__(self, stem: str) -> None:
        self.lines = list[str]()
        self._stem = stem
        self._names = set[str]()
        self._images: dict[str, bytes] = {}

    def add(self, mesh: Mesh) -> list[str]:
        """Adds the materials of a mesh. Returns their names in the file."""
        assert mesh.materials is not None
        images = [
            self._image_name(texture.image.tobytes(), texture.kind) for texture in mesh.materials.textures
        ]
        return [self._add_material(material, images) for material in make_plain_materials(mesh.materials)]

    def add_plain_material(self) -> str:
        """Returns the name of a white material, for faces without a material."""
        if "plain" not in self._names:
            self._names.add("plain")
            self.lines.append("newmtl plain\nKd 1 1 1\n")
        return "plain"

    def write_into(self, folder: Path) -> None:
        """Writes the material file and the images, if there are any."""
        if self.lines:
            (folder / f"{self._stem}.mtl").write_text("".join(self.lines), "utf-8")
        for name, data in self._images.items():
            (folder / name).write_bytes(data)

    def _add_material(self, material: PlainMaterial, images: list[str]) -> str:
        name = f"{len(self._names) + 1}_{'_'.join(material.name.split()) or 'material'}"
        self._names.add(name)
        red, green, blue, opacity = material.base
        self.lines += [
            f"newmtl {name}\n",
            f"Kd {red:.6f} {green:.6f} {blue:.6f}\n",
            f"Ke {' '.join(f'{value:.6f}' for value in material.emissive)}\n",
            f"d {opacity if material.mode == 'BLEND' else 1.0:.6f}\n",
            f"Pr {material.roughness:.6f}\nPm {material.metallic:.6f}\n",
        ]
        for word, use in (
            ("map_Kd", material.base_map),
            ("map_Ke", material.emissive_map),
            ("norm", material.normal_map),
        ):
            # The format has a single set of texture coordinates.
            if use is not None and use.uv_set == 0:
                self.lines.append(f"{word} {images[use.texture]}\n")
        return name

    def _image_name(self, data: bytes, kind: str) -> str:
        for name, image in self._images.items():
            if image == data:
                return name
        name = f"{self._stem}_texture_{len(self._images) + 1}{image_suffix(kind)}"
        self._images[name] = data
        return name
