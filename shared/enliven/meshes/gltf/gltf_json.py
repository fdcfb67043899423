"""Reads the JSON of a glTF or GLB file, and limits all amounts that the file declares.

A small file can declare millions of numbers, for example by an accessor without bytes, or by a mesh that a
thousand nodes show. So these amounts are counted in linear time before any data is read.
"""

from __future__ import annotations

import json
import struct
from typing import Any

from enliven.errors import InputError, find_plain_reason

GLTF_SUFFIXES = (".glb", ".gltf", ".vrm")
"""File suffixes of glTF. A VRM avatar is a GLB with a map of its human bones."""
MAX_LISTED_ENTRIES = 1 << 16
"""Maximum number of entries in one list of a file (nodes, accessors, meshes, ...). Scenes have thousands, and
reading an entry takes 0.1 ms."""
MAX_NODE_DEPTH = 512
"""Maximum depth of the node tree. It bounds the time for visiting all ancestors of a node. The deepest known
rigs have about 100 levels."""
MAX_ELEMENTS = 1 << 25
"""Maximum number of elements of an accessor, and of all shown vertices and indices together: 0.8 GB as
float64. It is 16 times the limit of the network protocol (2 million vertices)."""
MAX_READ_ELEMENTS = 1 << 27
"""Maximum number of elements that samplers and skins read. An accessor counts once per reference. An hour of
animation of 100 joints has 30 million elements."""
_DOCUMENT_LISTS = (
    "accessors",
    "animations",
    "buffers",
    "bufferViews",
    "images",
    "materials",
    "meshes",
    "nodes",
    "scenes",
    "skins",
    "textures",
)
_GLB_HEADER = struct.Struct("<4sII")
"""The header of a GLB: magic, version and length in bytes."""
_CHUNK_HEADER = struct.Struct("<I4s")
"""The header of a chunk: length in bytes and kind."""


class Entry:
    """An object of the JSON with its entries as attributes. Missing entries are None."""

    def __init__(self, entries: dict[str, Any]) -> None:
        self.__dict__.update(entries)

    def __getattr__(self, name: str) -> Any:
        return None


def gltf_tree(data: bytes) -> dict[str, Any]:
    """Parses the JSON object of a glTF or GLB file, and checks its amounts.

    Raises:
        InputError: if the file has no valid JSON object, or declares more than the reader's limits.
    """
    try:
        tree = json.loads(_json_text(data))
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise InputError(f"the JSON text of the file is damaged{_error_position(error)}") from None
    if not isinstance(tree, dict):
        raise InputError("the JSON text of the file is not an object")
    try:
        _check_amounts(tree)
    except (AttributeError, KeyError, TypeError, IndexError, OverflowError) as error:
        raise InputError(f"the JSON text of the file is damaged: {find_plain_reason(error)}") from None
    return tree


def gltf_document(data: bytes) -> tuple[Entry, list[int], bytes | None]:
    """Parses a glTF or GLB file. Returns the document, each node's parent (-1 at a root), and the binary
    chunk of a GLB.

    Raises:
        InputError: in the same cases as :func:`gltf_tree`.
    """
    tree = gltf_tree(data)
    parents = node_parents([node.get("children") or [] for node in tree.get("nodes") or []])
    document: Entry = json.loads(_json_text(data), object_hook=Entry)
    for name in _DOCUMENT_LISTS:
        if getattr(document, name) is None:
            setattr(document, name, [])
    return document, parents, _read_first_chunk(data, b"BIN\0")


def node_parents(children: list[list[int]]) -> list[int]:
    """Returns the parent of each node (-1 at a root), given the children of each node.

    Raises:
        InputError: if a child is missing or has two parents, and for a cycle or a tree that is too deep.
    """
    parents = [-1] * len(children)
    for number, child_list in enumerate(children):
        for child in child_list:
            if not 0 <= child < len(children) or parents[child] >= 0 or child == number:
                raise InputError(
                    f"node {number} has the child {child}, which does not exist or has another parent"
                )
            parents[child] = number
    level = [node for node, parent in enumerate(parents) if parent < 0]
    visited_count, depth = len(level), 1
    while level:
        if depth > MAX_NODE_DEPTH:
            raise InputError(f"the nodes are nested in more than {MAX_NODE_DEPTH} levels")
        level = [child for node in level for child in children[node]]
        visited_count, depth = visited_count + len(level), depth + 1
    if visited_count < len(children):
        raise InputError("the parents and children of the nodes form a cycle")
    return parents


def _error_position(error: Exception) -> str:
    """Returns the position at which a parser stopped, as a suffix for a message, or "" if the position is
    unknown."""
    if isinstance(error, RecursionError):
        return ": the JSON is nested too deeply"
    return f" in line {error.lineno}" if isinstance(error, json.JSONDecodeError) else ""


def _json_text(data: bytes) -> str:
    """Returns the JSON text of a file: the whole of a glTF file, or the JSON chunk of a GLB."""
    text = data
    if data[:4] == b"glTF":
        chunk = _read_first_chunk(data, b"JSON")
        if chunk is None:
            raise InputError("the file contains no JSON text, so it is truncated or damaged")
        text = chunk
    return text.decode("utf-8-sig")


def _read_first_chunk(data: bytes, requested_kind: bytes) -> bytes | None:
    """Returns the first chunk of the given kind in a GLB. The chunk may be truncated."""
    offset = _GLB_HEADER.size if data[:4] == b"glTF" else len(data)
    while offset + _CHUNK_HEADER.size <= len(data):
        length, kind = _CHUNK_HEADER.unpack_from(data, offset)
        offset += _CHUNK_HEADER.size
        if kind == requested_kind:
            return data[offset : offset + length]
        offset += length
    return None


def _check_amounts(tree: dict[str, Any]) -> None:
    """Raises an error for a file with too many entries, vertices, primitives or keys."""
    for name, entries in tree.items():
        if isinstance(entries, list) and len(entries) > MAX_LISTED_ENTRIES:
            raise InputError(
                f"the file has {len(entries)} {name}, but at most {MAX_LISTED_ENTRIES} are allowed"
            )
    nodes = tree.get("nodes") or []
    node_parents([node.get("children") or [] for node in nodes])
    counts = [_element_count(accessor) for accessor in tree.get("accessors") or []]
    _check_shown(tree, nodes, counts)
    _check_read(tree, counts)


def _check_shown(tree: dict[str, Any], nodes: list[Any], counts: list[int]) -> None:
    """Raises an error for too many vertices or primitives. Each counts once per node that shows it."""
    shown: dict[int, int] = {}
    for node in nodes:
        if node.get("mesh") is not None:
            shown[node["mesh"]] = shown.get(node["mesh"], 0) + 1
    total, primitives = 0, 0
    for number, mesh in enumerate(tree.get("meshes") or []):
        times = max(shown.get(number, 0), 1)
        for primitive in mesh.get("primitives") or []:
            accessor_numbers = [primitive.get("indices"), *(primitive.get("attributes") or {}).values()]
            total += times * max(
                (
                    counts[accessor_number]
                    for accessor_number in accessor_numbers
                    if _is_valid_index(accessor_number, counts)
                ),
                default=0,
            )
            primitives += times
    if total > MAX_ELEMENTS:
        raise InputError(
            f"the file has {total} vertices or triangle corners, but at most {MAX_ELEMENTS} are allowed"
        )
    if primitives > MAX_LISTED_ENTRIES:
        raise InputError(
            f"the file has {primitives} mesh primitives, but at most {MAX_LISTED_ENTRIES} are allowed"
        )


def _check_read(tree: dict[str, Any], counts: list[int]) -> None:
    """Raises an error if animation samplers and skins read too many elements."""
    accessor_numbers = [skin.get("inverseBindMatrices") for skin in tree.get("skins") or []]
    for animation in tree.get("animations") or []:
        channels = animation.get("channels") or []
        if len(channels) > MAX_LISTED_ENTRIES:
            raise InputError(
                f"an animation has {len(channels)} channels, but at most {MAX_LISTED_ENTRIES} are allowed"
            )
        samplers = animation.get("samplers") or []
        accessor_numbers += [
            sampler.get(entry_name) for sampler in samplers for entry_name in ("input", "output")
        ]
    total = sum(
        counts[accessor_number]
        for accessor_number in accessor_numbers
        if _is_valid_index(accessor_number, counts)
    )
    if total > MAX_READ_ELEMENTS:
        raise InputError(
            f"the animations and skins have {total} values, but at most {MAX_READ_ELEMENTS} are allowed"
        )


def _element_count(accessor: dict[str, Any]) -> int:
    """Returns the declared number of elements of an accessor."""
    count = accessor.get("count")
    if not isinstance(count, int) or not 0 <= count <= MAX_ELEMENTS:
        raise InputError(f"an accessor declares {count} elements, but at most {MAX_ELEMENTS} are allowed")
    return count


def _is_valid_index(at: Any, counts: list[int]) -> bool:
    return isinstance(at, int) and 0 <= at < len(counts)
