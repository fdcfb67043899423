"""Reader of Wavefront OBJ: polygons, vertex colours, and the diffuse colours of its materials.

The file is read twice, in blocks: first for the faces, then for the vertices that the faces use. So unused
vertices need no memory.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from enliven.arrays import AnyArray, Bool, Float, Int, UInt8
from enliven.errors import InputError
from enliven.files import ReferencedFiles, decode_text, text_bytes
from enliven.meshes.mesh import Mesh
from enliven.meshes.polygons import triangulate
from enliven.meshes.tokens import (
    DamagedMeshError,
    WrongWordError,
    parse_numbers,
    remove_comments,
    split_into_blocks,
    word_lines,
    word_starts,
)

_DEFAULT_GREY = 200
"""sRGB grey value of faces without a material, in a file with materials."""
_SPACE_BYTES = (ord(" "), ord("\t"))


class _LineError(Exception):
    """An error in a line of the file. It stores the byte offset of the line's start."""

    def __init__(self, offset: int, what: str) -> None:
        super().__init__(what)
        self.offset = offset


class _Lines(NamedTuple):
    """The lines of a block of text: start, length, and the first two letters of the first word of each."""

    starts: Int
    lengths: Int
    first: Int
    letters: AnyArray

    def mark_lines_starting_with(self, letter: str, second: str = " ") -> Bool:
        """Returns (L,) flags of lines that start with these letters.

        A blank as second letter means the end of the word.
        """
        letters = _SPACE_BYTES if second == " " else (ord(second),)
        return np.asarray((self.letters[:, 0] == ord(letter)) & np.isin(self.letters[:, 1], letters))


@dataclass
class _Faces:
    """The polygons of a file, one list entry per block.

    Attributes:
        corners: (C, 3) numbers of vertex, texture coordinate and normal of each corner. -1 for none.
        sizes: (P,) number of corners of each polygon.
        materials: (P,) the index in ``names`` of each polygon's material, -1 for none.
        offsets: (P,) byte offset in the file of each polygon's line.
        vertices_in_block: the number of vertices in each block, in the order of the file.
    """

    corners: list[Int] = field(default_factory=list)
    sizes: list[Int] = field(default_factory=list)
    materials: list[Int] = field(default_factory=list)
    offsets: list[Int] = field(default_factory=list)
    names: dict[bytes, int] = field(default_factory=dict)
    libraries: list[bytes] = field(default_factory=list)
    current: int = -1
    vertices_in_block: list[int] = field(default_factory=list)

    @property
    def vertex_count(self) -> int:
        """The number of vertices in the file, used or not."""
        return sum(self.vertices_in_block)


def read_obj(data: bytes, beside: ReferencedFiles, name: str = "mesh") -> tuple[Mesh, list[str]]:
    """Returns the mesh of an OBJ file and notes on omitted content.

    Vertices are split if corners differ in texture coordinates or normals, and at material boundaries.

    Args:
        beside: opens the material files that the OBJ file references.

    Raises:
        DamagedMeshError: if a line is wrong (the message gives its number), or if the file has no faces.
    """
    text = text_bytes(data)
    try:
        # Join continued lines without changing their length, so that offsets still point to lines of the
        # file.
        return _read_mesh(text.replace(b"\\\n", b"  "), beside, name)
    except _LineError as error:
        raise DamagedMeshError(f"line {text.count(bytes([10]), 0, error.offset) + 1}: {error}") from None


def _read_mesh(text: bytes, beside: ReferencedFiles, name: str) -> tuple[Mesh, list[str]]:
    faces = _read_faces(text)
    corners, sizes = _concatenate_parts(faces.corners, (0, 3)), _concatenate_parts(faces.sizes, (0,))
    if not (sizes > 2).any():
        raise InputError("the file has no faces")
    invalid_corners = np.flatnonzero(corners[:, 0] >= faces.vertex_count)
    if len(invalid_corners):
        polygon = np.searchsorted(np.cumsum(sizes), invalid_corners[0], "right")
        problem = (
            f"a face refers to vertex {corners[invalid_corners[0], 0] + 1}, but only "
            f"{faces.vertex_count} vertices exist"
        )
        raise _LineError(int(_concatenate_parts(faces.offsets, (0,))[polygon]), problem)
    is_used = np.zeros(faces.vertex_count, bool)
    is_used[corners[:, 0]] = True
    vertices, colours = _read_vertices(text, is_used, faces.vertices_in_block)
    corners[:, 0] = np.searchsorted(np.flatnonzero(is_used), corners[:, 0])
    notes = list[str]()
    if len(vertices) < faces.vertex_count:
        unused_count = faces.vertex_count - len(vertices)
        notes.append(
            f"{unused_count} of {faces.vertex_count} vertices were removed, because no face uses them"
        )
    palette = _read_palette(faces, beside, notes)
    materials = _concatenate_parts(faces.materials, (0,))
    _, used_corners = triangulate(vertices, corners[:, 0], sizes)
    kinds = np.column_stack([corners, np.repeat(materials, sizes)])
    split, source, kind = _split_vertices(kinds)
    vertices = vertices[source]
    if palette is not None:
        colours = palette[kind]
    elif colours is not None:
        colours = colours[source]
    return Mesh(vertices, split[used_corners].astype(np.int32), name, colours), notes


def _concatenate_parts(parts: list[Int], empty: tuple[int, ...]) -> Int:
    return np.concatenate(parts) if parts else np.empty(empty, np.int64)


def _find_lines(block: bytes) -> _Lines:
    """Finds the lines of a block that ends with a line feed."""
    letters = np.frombuffer(block, np.uint8)
    ends = np.flatnonzero(letters == ord("\n"))
    starts = np.concatenate([[0], ends[:-1] + 1])
    first = starts
    if np.isin(letters[starts], _SPACE_BYTES).any():
        solid = np.flatnonzero(~np.isin(letters, _SPACE_BYTES))
        first = solid[np.searchsorted(solid, starts)]
    pairs = np.stack([letters[first], letters[np.minimum(first + 1, len(letters) - 1)]], 1)
    return _Lines(starts, ends + 1 - starts, first, pairs)


def _number_lines(block: bytes, lines: _Lines, are: Bool) -> bytes:
    """Returns the lines of a block that are selected by the mask ``are`` (L,), without their first word and
    comments. The number of lines does not change."""
    letters = np.frombuffer(block, np.uint8).copy()
    letters[lines.first[are]] = ord(" ")
    return remove_comments(letters[np.repeat(are, lines.lengths)].tobytes())


def _read_faces(text: bytes) -> _Faces:
    """Returns the polygons of a file, and counts its vertices."""
    faces, counts = _Faces(), np.zeros(3, np.int64)
    for offset, part in split_into_blocks(text):
        block = part if part.endswith(b"\n") else part + b"\n"
        lines = _find_lines(block)
        kinds = np.stack(
            [
                lines.mark_lines_starting_with("v"),
                lines.mark_lines_starting_with("v", "t"),
                lines.mark_lines_starting_with("v", "n"),
            ],
            1,
        )
        counts_before = counts + np.cumsum(kinds, 0) - kinds
        counts = counts + kinds.sum(0)
        faces.vertices_in_block.append(int(kinds[:, 0].sum()))
        are_faces = lines.mark_lines_starting_with("f")
        materials = _materials_by_line(block, lines, faces)
        if not are_faces.any():
            continue
        line_offsets = offset + lines.starts[are_faces]
        corners, sizes = _read_polygons(
            _number_lines(block, lines, are_faces), line_offsets, counts_before[are_faces]
        )
        faces.corners.append(corners)
        faces.sizes.append(sizes)
        faces.materials.append(materials[are_faces])
        faces.offsets.append(line_offsets)
    return faces


def _materials_by_line(block: bytes, lines: _Lines, faces: _Faces) -> Int:
    """Returns the current material (L,) of each line.

    Adds names of materials and of material files to ``faces``.
    """
    changes, values = [0], [faces.current]
    for k in np.flatnonzero(
        lines.mark_lines_starting_with("u", "s") | lines.mark_lines_starting_with("m", "t")
    ):
        line = block[lines.first[k] : lines.starts[k] + lines.lengths[k]]
        word, _, rest = line.partition(b" " if b" " in line else b"\t")
        if word == b"usemtl":
            faces.current = faces.names.setdefault(rest.strip(), len(faces.names))
            changes.append(int(k))
            values.append(faces.current)
        elif word == b"mtllib" and rest.strip() not in faces.libraries:
            faces.libraries.append(rest.strip())
    lengths = np.diff([*changes, len(lines.starts)])
    return np.repeat(np.array(values, np.int64), lengths)


def _read_polygons(chunk: bytes, offsets: Int, element_counts: Int) -> tuple[Int, Int]:
    """Returns (C, 3) corners and (P,) sizes of the face lines in ``chunk``.

    Args:
        offsets: (P,) byte offset in the file of each line.
        element_counts: (P, 3) number of vertices, texture coordinates and normals above each line, for
            negative indices.
    """
    if b"/" in chunk:
        # Write an omitted index as 0, which is never a valid index.
        chunk = chunk.replace(b"//", b"/0/").replace(b"/ ", b"/0 ").replace(b"/\n", b"/0\n")
    starts = word_starts(chunk)
    polygon = word_lines(chunk, starts)
    slashes = np.frombuffer(chunk, np.uint8) == ord("/")
    part_counts = 1 + (np.add.reduceat(slashes, starts, dtype=np.int64) if len(starts) else starts)
    try:
        numbers = parse_numbers(chunk.replace(b"/", b" "), np.int64)
    except WrongWordError as error:
        raise _LineError(int(offsets[error.line]), error.what) from None
    first_parts = np.cumsum(part_counts) - part_counts
    corners = np.full((len(starts), 3), -1, np.int64)
    for column in range(3):
        has = np.flatnonzero(part_counts > column)
        indices = numbers[first_parts[has] + column]
        corners[has, column] = np.where(
            indices < 0, element_counts[polygon[has], column] + indices, indices - 1
        )
        wrong = corners[:, 0] < 0 if column == 0 else np.zeros(0, bool)
        if wrong.any():
            wrong_corner = int(np.argmax(wrong))
            problem = (
                "vertex numbers begin at 1"
                if indices[wrong_corner] == 0
                else "fewer vertices precede this face"
            )
            raise _LineError(
                int(offsets[polygon[wrong_corner]]),
                f"a face refers to vertex {indices[wrong_corner]}, but {problem}",
            )
    return corners, np.bincount(polygon, minlength=len(offsets))


def _read_vertices(text: bytes, is_used: Bool, in_block: list[int]) -> tuple[Float, UInt8 | None]:
    """Returns the used vertices (U, 3), and their colours (U, 3) or None.

    Blocks without used vertices are skipped.
    """
    vertices, colours, count = list[Float](), list[Float](), 0
    for (offset, block), vertex_count in zip(split_into_blocks(text), in_block, strict=True):
        used = is_used[count : count + vertex_count]
        count += vertex_count
        if not used.any():
            continue
        complete = block if block.endswith(b"\n") else block + b"\n"
        lines = _find_lines(complete)
        are = lines.mark_lines_starting_with("v")
        are[are] = used
        chunk = _number_lines(complete, lines, are)
        offsets = offset + lines.starts[are]
        starts = word_starts(chunk)
        counts = np.bincount(word_lines(chunk, starts), minlength=len(offsets))
        if counts.min() < 3:
            problem = f"a vertex has only {counts.min()} numbers, expected 3 or more"
            raise _LineError(int(offsets[np.argmin(counts)]), problem)
        try:
            numbers = parse_numbers(chunk)
        except WrongWordError as error:
            raise _LineError(int(offsets[error.line]), error.what) from None
        first = np.cumsum(counts) - counts
        vertices.append(numbers[first[:, None] + np.arange(3)])
        has = counts >= 6
        colour = np.full((len(first), 3), np.nan)
        colour[has] = numbers[first[has, None] + np.arange(3, 6)]
        colours.append(colour)
    return np.concatenate(vertices), _colour_bytes(np.concatenate(colours))


def _colour_bytes(colours: Float) -> UInt8 | None:
    """Returns (V, 3) sRGB bytes from colours in 0..1, or in 0..255 if one is above 1.

    Colours that are not finite become grey. Returns None if no colour is finite.
    """
    is_coloured: Bool = np.asarray(np.isfinite(colours).all(1))
    if not is_coloured.any():
        return None
    scale = 255.0 if colours[is_coloured].max() <= 1.0 else 1.0
    shown = np.where(is_coloured[:, None], colours * scale, _DEFAULT_GREY)
    return np.clip(np.rint(shown), 0, 255).astype(np.uint8)


def _read_palette(faces: _Faces, beside: ReferencedFiles, notes: list[str]) -> UInt8 | None:
    """Returns (M + 1, 3) sRGB colours of the M used materials. The last entry is the grey of faces without a
    material.

    Returns None if no material has a colour.
    """
    colours_by_name: dict[str, tuple[float, float, float]] = {}
    for library in faces.libraries:
        try:
            colours_by_name.update(_read_materials(decode_text(beside.read_named_file(decode_text(library)))))
        except InputError as error:
            notes.append(f"the materials of the mesh are ignored: {error.what}")
    palette = np.full((len(faces.names) + 1, 3), _DEFAULT_GREY, np.uint8)
    has_colour = False
    for name, number in faces.names.items():
        colour = colours_by_name.get(decode_text(name))
        if colour is not None:
            palette[number] = np.rint(255 * np.clip(colour, 0.0, 1.0))
            has_colour = True
    return palette if has_colour else None


def _read_materials(text: str) -> dict[str, tuple[float, float, float]]:
    """Returns the diffuse colours in 0..1 of the materials of an MTL file by name.

    Other entries are skipped.
    """
    colours: dict[str, tuple[float, float, float]] = {}
    name = ""
    for line in text.split("\n"):
        word, *rest = line.split(None, 1) or [""]
        if word.lower() == "newmtl":
            name = rest[0].strip() if rest else ""
        elif word.lower() == "kd" and rest:
            try:
                r, g, b = (float(number) for number in rest[0].split()[:3])
            except ValueError:
                continue
            if np.isfinite([r, g, b]).all():
                colours[name] = (r, g, b)
    return colours


def _split_vertices(kinds: Int) -> tuple[Int, Int, Int]:
    """Splits vertices if their corners differ in texture coordinate, normal or material.

    Vertices of the last material come first, then those of the other materials in the order of the file.
    Stored sessions refer to vertices by their numbers in this order, so it must not change.

    Args:
        kinds: (C, 4) vertex, texture coordinate, normal and material of each corner.

    Returns:
        (C,) the new vertex of each corner, (N,) the old vertex of each new vertex, and (N,) the material of
        each new vertex.
    """
    key = np.zeros(len(kinds), np.int64)
    for column in (-kinds[:, 3], kinds[:, 0], kinds[:, 1], kinds[:, 2]):
        distinct, new_indices = np.unique(column, return_inverse=True)
        key = np.unique(key * len(distinct) + new_indices.reshape(-1), return_inverse=True)[1].reshape(-1)
    _, first_corners, key = np.unique(key, return_index=True, return_inverse=True)
    return key.reshape(-1), kinds[first_corners, 0], kinds[first_corners, 3]
