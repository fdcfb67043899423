"""Reader of PLY files (ASCII and binary). It reads polygons and vertex colours, and skips other elements and
properties."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from enliven.arrays import AnyArray, Float, UInt8
from enliven.files import text_bytes
from enliven.meshes.mesh import Mesh
from enliven.meshes.polygons import triangulate
from enliven.meshes.tokens import DamagedMeshError, parse_numbers

_NUMPY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
"""NumPy type for each type name in a PLY header."""
_MAX_PROPERTIES = 256
"""Maximum number of properties in a file. Scanners write about 20."""
_MAX_HEAD_BYTES = 1 << 16
"""Maximum size of a header with its comments, in bytes."""
_MAX_SIDES = 1 << 16
"""Maximum number of corners of a polygon. Even the outline of a scan has only a few thousand corners."""
_HEADER_END = re.compile(rb"^[ \t]*end_header[ \t]*(?:\r\n|\n|\r)", re.MULTILINE | re.IGNORECASE)
_CORNER_PROPERTIES = ("vertex_indices", "vertex_index", "vertex_indexes")


@dataclass
class _Element:
    """A table of the file, such as its vertices or its faces.

    Attributes:
        properties: (name, type, type of the list length) of each column. The last is "" unless the column
            contains lists.
    """

    name: str
    count: int
    properties: list[tuple[str, str, str]] = field(default_factory=list)

    @property
    def has_lists(self) -> bool:
        """True if a column contains lists, so that rows may differ in length."""
        return any(count for _, _, count in self.properties)


def read_ply(data: bytes, name: str = "mesh") -> tuple[Mesh, list[str]]:
    """Returns the mesh of a PLY file, and notes on unusual content.

    Raises:
        DamagedMeshError: if it is not a PLY file, has a broken header, or is shorter than declared.
    """
    kind, elements, body = _read_head(data)
    tables = _ascii_tables(elements, body) if kind == "ascii" else _binary_tables(elements, body, kind)
    notes = list[str]()
    extra = tables.pop("", None)
    if extra is not None:
        notes.append(
            f"{len(extra['rest'])} {'numbers' if kind == 'ascii' else 'bytes'} after the last "
            "element of the file were ignored"
        )
    vertex, face = tables.get("vertex", {}), tables.get("face", {})
    if not all(axis in vertex for axis in "xyz"):
        raise DamagedMeshError("the header does not declare vertices with x, y and z")
    vertices = np.stack([vertex[axis] for axis in "xyz"], 1).astype(np.float64)
    key = next((word for word in _CORNER_PROPERTIES if word in face), "")
    corners = face[key].astype(np.int64) if key else np.empty(0, np.int64)
    sizes = face[f"{key} count"] if key else np.empty(0, np.int64)
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(vertices):
        bad_corner = int(np.argmax((corners < 0) | (corners >= len(vertices))))
        polygon = int(np.searchsorted(np.cumsum(sizes), bad_corner, "right"))
        raise DamagedMeshError(
            f"face {polygon} refers to vertex {corners[bad_corner]}, but the vertices are numbered "
            f"0..{len(vertices) - 1}"
        )
    faces, _ = triangulate(vertices, corners, sizes)
    return Mesh(vertices, faces, name, _vertex_colours(vertex)), notes


def _read_head(data: bytes) -> tuple[str, list[_Element], bytes]:
    """Returns the format, the elements and the bytes after the header."""
    data = data.removeprefix(b"\xef\xbb\xbf")
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        data = text_bytes(data)
    end = _HEADER_END.search(data, 0, _MAX_HEAD_BYTES)
    if not data[:16].lstrip().lower().startswith(b"ply") or end is None:
        raise DamagedMeshError("the file has no PLY header")
    kind, elements = "", list[_Element]()
    lines = text_bytes(data[: end.start()]).decode("utf-8", "replace").split("\n")
    count = sum(line.split()[:1] == ["property"] for line in lines)
    if count > _MAX_PROPERTIES:
        raise DamagedMeshError(
            f"the header declares {count} properties, but at most {_MAX_PROPERTIES} are allowed"
        )
    for line in lines:
        match line.split():
            case ["format", "ascii" | "binary_little_endian" | "binary_big_endian" as kind, *_]:
                pass
            case ["element", word, count] if count.isdecimal() and int(count) <= len(data):
                elements.append(_Element(word, int(count)))
            case ["property", "list", count, of, word] if elements and {count, of} <= _NUMPY_TYPES.keys():
                elements[-1].properties.append((word, _NUMPY_TYPES[of], _NUMPY_TYPES[count]))
            case ["property", of, word] if elements and of in _NUMPY_TYPES:
                elements[-1].properties.append((word, _NUMPY_TYPES[of], ""))
            case ["property" | "element" | "format", *_]:
                raise DamagedMeshError(
                    f"this line of the header is not valid for a file of {len(data)} bytes: "
                    f"{line.strip()[:80]!r}"
                )
            case _:
                pass  # The line is "ply", a comment, or the object information of a scanner.
    if not kind:
        raise DamagedMeshError("the header declares no format")
    return kind, elements, data[end.end() :]


def _make_early_end_error(element: _Element) -> DamagedMeshError:
    return DamagedMeshError(
        f"the file ends early: the header declares {element.count} rows of {element.name!r}"
    )


def _ascii_tables(elements: list[_Element], body: bytes) -> dict[str, dict[str, AnyArray]]:
    """Returns the columns of each element by name. The entry "" contains the numbers after the last
    element."""
    tables: dict[str, dict[str, AnyArray]] = {}
    numbers = parse_numbers(text_bytes(body))
    offset = 0
    for element in elements:
        width = len(element.properties)
        if not element.has_lists:
            rows = numbers[offset : offset + element.count * width]
            if len(rows) < element.count * width:
                raise _make_early_end_error(element)
            columns = rows.reshape(-1, width).T if width else rows.reshape(0, 0)
            properties = zip(element.properties, columns, strict=True)
            tables[element.name] = {
                word: _read_typed_column(column, of) for (word, of, _), column in properties
            }
            offset += element.count * width
            continue
        tables[element.name], offset = _walk_ascii(element, numbers, offset)
    if offset < len(numbers):
        tables[""] = {"rest": numbers[offset:]}
    return tables


def _read_typed_column(column: Float, of: str) -> AnyArray:
    """Returns the numbers (N,) of a column, converted to integers if its declared type ``of`` is an integer
    type."""
    return column if of[0] == "f" else np.rint(np.nan_to_num(column)).astype(np.int64)


def _walk_ascii(element: _Element, numbers: Float, at: int) -> tuple[dict[str, AnyArray], int]:
    """Returns the columns of an element with lists, and the offset after it.

    The list lengths in the data determine the length of each row.
    """
    only = element.properties[0] if len(element.properties) == 1 else None
    first = int(numbers[at]) if at < len(numbers) and 0 <= numbers[at] <= _MAX_SIDES else 0
    block = numbers[at : at + element.count * (1 + first)]
    if only and first and len(block) == element.count * (1 + first):
        rows = block.reshape(-1, 1 + first)
        if (rows[:, 0] == first).all():
            columns = {only[0]: rows[:, 1:].reshape(-1), f"{only[0]} count": np.full(len(rows), first)}
            return columns, at + len(block)
    parts: dict[str, list[AnyArray]] = {}
    counts: dict[str, list[int]] = {}
    for _ in range(element.count):
        for word, _, count in element.properties:
            if at >= len(numbers):
                raise _make_early_end_error(element)
            list_length = 1
            if count:
                list_length = _list_length(float(numbers[at]))
                counts.setdefault(word, []).append(list_length)
                at += 1
            if at + list_length > len(numbers):
                raise _make_early_end_error(element)
            parts.setdefault(word, []).append(numbers[at : at + list_length])
            at += list_length
    return _join_columns(parts, counts), at


def _list_length(count: float) -> int:
    """Returns the length of a list.

    Raises:
        DamagedMeshError: if it is not an integer, negative or too large for a polygon.
    """
    if not 0 <= count <= _MAX_SIDES or count != int(count):
        raise DamagedMeshError(f"a list declares an invalid number of entries: {count:g}")
    return int(count)


def _join_columns(parts: dict[str, list[AnyArray]], counts: dict[str, list[int]]) -> dict[str, AnyArray]:
    columns = {word: np.concatenate(rows) for word, rows in parts.items()}
    return columns | {f"{word} count": np.array(many, np.int64) for word, many in counts.items()}


def _binary_tables(elements: list[_Element], body: bytes, kind: str) -> dict[str, dict[str, AnyArray]]:
    """Returns the tables of a binary body; see :func:`_ascii_tables`."""
    order = "<" if kind == "binary_little_endian" else ">"
    tables: dict[str, dict[str, AnyArray]] = {}
    offset = 0
    for element in elements:
        if element.has_lists:
            tables[element.name], offset = _walk_binary(element, body, offset, order)
            continue
        row = np.dtype([(f"{k}", order + of) for k, (_, of, _) in enumerate(element.properties)])
        if offset + element.count * row.itemsize > len(body):
            raise _make_early_end_error(element)
        table = np.frombuffer(body, row, element.count, offset) if row.itemsize else np.empty(0, row)
        offset += element.count * row.itemsize
        tables[element.name] = {word: table[f"{k}"] for k, (word, _, _) in enumerate(element.properties)}
    if offset < len(body):
        tables[""] = {"rest": np.frombuffer(body, np.uint8, -1, offset)}
    return tables


def _walk_binary(element: _Element, body: bytes, at: int, order: str) -> tuple[dict[str, AnyArray], int]:
    """Returns the columns of an element with lists, and the offset after it.

    If all rows have the length of the first row, they are read as one table.
    """
    if element.count == 0:
        return {}, at
    row, value_counts = _row_at(element, body, at, order)
    if row.itemsize and at + element.count * row.itemsize <= len(body):
        table = np.frombuffer(body, row, element.count, at)
        lists = [k for k, (_, _, count) in enumerate(element.properties) if count]
        if all((table[f"n{k}"] == value_counts[k]).all() for k in lists):
            columns = {word: table[f"{k}"].reshape(-1) for k, (word, _, _) in enumerate(element.properties)}
            for k in lists:
                columns[f"{element.properties[k][0]} count"] = np.full(element.count, value_counts[k])
            return columns, at + element.count * row.itemsize
    return _walk_rows(element, body, at, order)


def _walk_rows(element: _Element, body: bytes, at: int, order: str) -> tuple[dict[str, AnyArray], int]:
    """Returns the columns of an element with rows of different lengths, and the offset after it."""
    sizes = [
        (np.dtype(count).itemsize if count else 0, np.dtype(of).itemsize)
        for _, of, count in element.properties
    ]
    endian: Literal["little", "big"] = "little" if order == "<" else "big"
    value_offsets: list[list[int]] = [[] for _ in sizes]
    counts: list[list[int]] = [[] for _ in sizes]
    for _ in range(element.count):
        for k, (counted, size) in enumerate(sizes):
            list_length = 1
            if counted:
                list_length = int.from_bytes(body[at : at + counted], endian)
                at += counted
                counts[k].append(list_length)
            value_offsets[k].append(at)
            at += list_length * size
        if at > len(body):
            raise _make_early_end_error(element)
    columns: dict[str, AnyArray] = {}
    raw = np.frombuffer(body, np.uint8)
    for k, (word, of, count) in enumerate(element.properties):
        lengths = np.array(counts[k], np.int64) if count else np.ones(element.count, np.int64)
        _list_length(float(lengths.max(initial=0)))
        index_in_list = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        first_bytes = np.repeat(np.array(value_offsets[k], np.int64), lengths) + index_in_list * sizes[k][1]
        values = raw[first_bytes[:, None] + np.arange(sizes[k][1])]
        columns[word] = values.reshape(-1).view(order + of)
        if count:
            columns[f"{word} count"] = lengths
    return columns, at


def _row_at(element: _Element, body: bytes, at: int, order: str) -> tuple[np.dtype, list[int]]:  # type: ignore[type-arg]
    """Returns the layout of the row at an offset, and the number of values in each column (1 for a column
    without lists)."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    value_counts = list[int]()
    for k, (_, of, count) in enumerate(element.properties):
        length = 1
        if count:
            size = np.dtype(count).itemsize
            if at + size > len(body):
                raise _make_early_end_error(element)
            length = _list_length(float(np.frombuffer(body, order + count, 1, at)[0]))
            fields.append((f"n{k}", order + count))
            at += size
        fields.append((f"{k}", order + of, (length,)))
        value_counts.append(length)
        at += length * np.dtype(of).itemsize
    return np.dtype(fields), value_counts


def _vertex_colours(vertex: dict[str, AnyArray]) -> UInt8 | None:
    """Returns (V, 3) sRGB bytes of the vertices, or None.

    Floating-point colours are in 0..1 unless one is above 1.
    """
    for prefix in ("", "diffuse_"):
        columns = [vertex.get(f"{prefix}{word}") for word in ("red", "green", "blue")]
        if all(column is not None for column in columns):
            colours: Float = np.nan_to_num(np.stack(columns, 1).astype(np.float64))  # type: ignore[arg-type]
            highest = colours.max(initial=0.0)
            if columns[0].dtype.kind == "f":  # type: ignore[union-attr]
                scale = 255.0 if highest <= 1.0 else 1.0
            else:
                scale = 1.0 if highest <= 255.0 else 255.0 / 65535.0
            return np.clip(np.rint(colours * scale), 0, 255).astype(np.uint8)
    return None
