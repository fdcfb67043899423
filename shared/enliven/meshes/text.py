"""Readers of two plain-text mesh formats: OFF and MEDIT (.mesh, surface or tetrahedra)."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from enliven.arrays import Float, Int, Int32
from enliven.files import decode_text, text_bytes
from enliven.meshes.polygons import triangulate
from enliven.meshes.tokens import DamagedMeshError, parse_numbers, remove_comments, word_lines, word_starts

_OFF_HEADER = re.compile(
    rb"\s*(?:(?P<kind>[STCN4]{0,5}OFF)\b\s*)?(?P<binary>BINARY\b)?"
    rb"(?:(?P<vertices>[+-]?\d{1,12})"
    rb"(?:[^\S\n]+(?P<faces>[+-]?\d{1,12})(?:[^\S\n]+[+-]?\d{1,12})?|\s+(?P<lower>[+-]?\d{1,12})\s+[+-]?\d{1,12})"
    rb"(?=\s))?",
    re.IGNORECASE,
)
"""Pattern of the header of an OFF file. The word OFF is optional. The count of edges is optional if the
counts are on one line."""
_OFF_EXTRAS = {b"N": 3, b"C": 4, b"ST": 2}
"""Number of additional values per vertex (normal, colour, texture coordinates), by the letters before OFF."""
_TETRAHEDRON_FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
_MEDIT_COLUMNS = {"Vertices": 4, "Triangles": 4, "Quadrilaterals": 5, "Tetrahedra": 5}
"""Number of values per line in each section of a Medit file: coordinates or vertex numbers, then a reference
number."""


def read_off(data: bytes) -> tuple[Float, Int32, list[str]]:
    """Reads an OFF file (also COFF, NOFF, STOFF). Returns (V, 3) vertices, (F, 3) triangles, and notes.

    A vertex or face may extend over several lines, and a line may contain several vertices or faces. Normals
    and texture coordinates are skipped. Colours are skipped with a note.

    Raises:
        DamagedMeshError: if the file contradicts its header.
    """
    text = remove_comments(text_bytes(data)) + b"\n"
    head = _OFF_HEADER.match(text)
    kind = (head["kind"] or b"").upper() if head else b""
    if head is None or not (kind or head["vertices"]):
        raise DamagedMeshError("the first word of the file is not OFF")
    if head["binary"] or b"4" in kind or b"nOFF" in head[0]:
        problem = "the file is binary" if head["binary"] else "the vertices do not have three coordinates"
        raise DamagedMeshError(
            f"{problem}. Only text files with three coordinates for each vertex can be read"
        )
    if head["vertices"] is None:
        raise DamagedMeshError("the numbers of vertices and faces are missing")
    count, face_count = int(head["vertices"]), int(head["faces"] or head["lower"])
    stated = f"the header declares {count} vertices and {face_count} faces"
    if count < 0 or face_count < 0:
        raise DamagedMeshError(stated)
    body = text[head.end() :]
    problem = f"the file ends early: {stated}"
    for vertices, faces_start in _off_vertices(body, count, kind):
        walked = _walk_faces(body[faces_start:], face_count, count)
        if not isinstance(walked, str):
            corners, sizes, rest = walked
            notes = [f"{rest} words after the last face of the file were ignored"] if rest else []
            if b"C" in kind.removesuffix(b"OFF"):
                notes.append("the vertex colours of the file are ignored; use a PLY or OBJ file for colours")
            return vertices, triangulate(vertices, corners, sizes)[0], notes
        problem = f"{stated}, and {walked}"
    raise DamagedMeshError(problem)


def _off_vertices(body: bytes, count: int, kind: bytes) -> Iterator[tuple[Float, int]]:
    """Yields the vertices (V, 3) and the offset after them for each possible layout of the file, the most
    likely layout first.

    In nearly every file, each vertex has its own line, with any number of colour values. Otherwise, the
    letters before OFF determine the number of values per vertex.
    """
    if count == 0:
        yield np.empty((0, 3)), 0
        return
    ends = _line_ends(body, count)
    rows = np.empty(0, np.int64)
    if len(ends) == count:
        part = body[: ends[-1]]
        rows = np.unique(word_lines(part, word_starts(part)), return_counts=True)[1]
        if rows.min() == rows.max() >= 3:
            yield _read_first_three(part, rows), len(part)
    width = 3 + sum(
        extra_count for letters, extra_count in _OFF_EXTRAS.items() if letters in kind.removesuffix(b"OFF")
    )
    starts = word_starts(body)
    if len(starts) >= count * width:
        vertices_end = int(starts[count * width]) if len(starts) > count * width else len(body)
        yield _read_first_three(body[:vertices_end], np.full(count, width)), vertices_end
    if len(rows) == count and rows.min() >= 3:
        yield _read_first_three(body[: ends[-1]], rows), int(ends[-1])


def _read_first_three(text: bytes, widths: Int) -> Float:
    """Returns the first three numbers (V, 3) of every vertex.

    ``widths`` (V,) is the number of values of each vertex.
    """
    numbers = parse_numbers(text)
    return numbers[(np.cumsum(widths) - widths)[:, None] + np.arange(3)]


def _line_ends(body: bytes, count: int) -> Int:
    """Returns the end offsets (L,) of the first ``count`` lines that are not blank. If there are fewer lines,
    returns all of them."""
    letters = np.frombuffer(body, np.uint8)
    ends = np.flatnonzero(letters == ord("\n")) + 1
    words = np.cumsum(letters > ord(" "), dtype=np.int64)[ends - 1]
    return np.asarray(ends[np.diff(words, prepend=0) > 0][:count])


def _walk_faces(body: bytes, count: int, vertex_count: int) -> tuple[Int, Int, int] | str:
    """Parses the faces. Returns their corners (C,), their sizes (P,), and the number of words after the last
    face. If the faces are invalid, returns a description of the error instead.

    Two layouts are tried: faces without colours, and faces with a colour that fills the rest of the line.
    """
    try:
        numbers = parse_numbers(body, np.int64)
    except ValueError:
        numbers = np.empty(0, np.int64)
    first = int(numbers[0]) if len(numbers) else 0
    rows = numbers[: count * (first + 1)]
    if first > 0 and len(rows) == count * (first + 1) and (rows[:: first + 1] == first).all():
        corners = rows.reshape(count, -1)[:, 1:].reshape(-1)
        if _find_invalid_corner(corners, vertex_count) is None:
            return corners, np.full(count, first), len(numbers) - len(rows)
    problem = ""
    lines = word_lines(body, word_starts(body))
    for words, after in (
        (numbers.tolist(), None),
        ([_parse_integer(word) for word in body.split()], np.searchsorted(lines, lines, "right").tolist()),
    ):
        corners, sizes, offset = list[int](), list[int](), 0
        while len(sizes) < count:
            size = words[offset] if offset < len(words) else -1
            if size < 0 or offset + size >= len(words):
                break
            corners += words[offset + 1 : offset + 1 + size]
            sizes.append(size)
            offset = offset + 1 + size if after is None else after[offset + size]
        wrong = _find_invalid_corner(np.array(corners, np.int64), vertex_count)
        if len(sizes) == count and wrong is None:
            return np.array(corners, np.int64), np.array(sizes, np.int64), len(words) - offset
        problem = f"face {len(sizes)} is truncated or invalid"
        if wrong is not None:
            problem = f"a face refers to vertex {wrong}, but the vertices are numbered 0..{vertex_count - 1}"
    return problem


def _find_invalid_corner(corners: Int, vertex_count: int) -> int | None:
    """Returns the first vertex number in ``corners`` that is outside of 0..``vertex_count`` - 1, or None if
    all are valid."""
    invalid = corners[(corners < 0) | (corners >= vertex_count)]
    return int(invalid[0]) if len(invalid) else None


def _parse_integer(word: bytes) -> int:
    """Parses an integer. Returns -1 for any other word, such as a colour value with a decimal point."""
    return int(word) if word.isdigit() and len(word) < 10 else -1


def read_medit(data: bytes) -> tuple[Float, Int32, list[str]]:
    """Reads an ASCII MEDIT file. Returns (V, 3) vertices, (F, 3) triangles, and an empty list of notes.

    If the file contains tetrahedra, the triangles are their boundary.

    Raises:
        DamagedMeshError: if the file is not MEDIT, or ends early.
    """
    words = decode_text(remove_comments(text_bytes(data))).split()
    if not words or words[0] != "MeshVersionFormatted":
        raise DamagedMeshError("the first word of the file is not MeshVersionFormatted")
    tables: dict[str, Float] = {}
    for i, word in enumerate(words[:-1]):
        if word in _MEDIT_COLUMNS:
            columns = _MEDIT_COLUMNS[word]
            if int(words[i + 1]) < 0:
                raise DamagedMeshError(f"the file declares a negative number of {word}: {words[i + 1]}")
            values = words[i + 2 : i + 2 + int(words[i + 1]) * columns]
            if len(values) < int(words[i + 1]) * columns:
                raise DamagedMeshError(f"the file ends early, in the list of {word}")
            tables[word] = np.array(values, np.float64).reshape(-1, columns)[:, :-1]
    if "Vertices" not in tables:
        raise DamagedMeshError("the file has no list of Vertices")
    triangles = [tables[t].astype(np.int64) - 1 for t in ("Triangles",) if t in tables]
    if "Quadrilaterals" in tables:
        quads = tables["Quadrilaterals"].astype(np.int64) - 1
        vertices = tables["Vertices"]
        if len(quads) and not 0 <= quads.min() <= quads.max() < len(vertices):
            raise DamagedMeshError(f"a quadrilateral refers to a vertex outside 1..{len(vertices)}")
        triangles.append(triangulate(vertices, quads.reshape(-1), np.full(len(quads), 4))[0].astype(np.int64))
    if not sum(map(len, triangles)) and "Tetrahedra" in tables:
        triangles = [_boundary_triangles(tables["Tetrahedra"].astype(np.int64) - 1)]
    faces = np.concatenate(triangles) if triangles else np.empty((0, 3))
    return tables["Vertices"], faces.astype(np.int32), []


def _boundary_triangles(tetrahedra: Int) -> Int:
    """Returns the triangles (F, 3) that belong to only one tetrahedron of (T, 4), facing outwards."""
    faces = tetrahedra[:, _TETRAHEDRON_FACES].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, 1), axis=0, return_index=True, return_counts=True)
    return np.asarray(faces[first[count == 1]])
