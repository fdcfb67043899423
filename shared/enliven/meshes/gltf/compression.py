"""Decodes the compressed parts of a glTF file.

Draco compresses the accessors of a primitive. Meshoptimizer compresses a buffer view that contains rows of
numbers or indices.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from enliven.arrays import AnyArray
from enliven.errors import InputError, ResourceError
from enliven.meshes.gltf.extensions import DRACO
from enliven.meshes.gltf.gltf_json import Entry

MAX_UNPACKED_BYTES = 1 << 29
"""Maximum total bytes of all decompressed buffer views of a file, 0.5 GB. A compressed file can declare a
thousand times its own size."""
_MODES = ("ATTRIBUTES", "TRIANGLES", "INDICES")
"""The kinds of data that meshoptimizer packs (EXT_meshopt_compression)."""
_FILTERS = ("NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR")
"""Filters that are reversed after decompression. COLOR is in KHR_meshopt_compression only."""
_MAX_ROW_BYTES = 256
"""Maximum bytes of a row, by the extension's specification."""


def draco_arrays(
    data: bytes, attributes: dict[str, int], where: str = ""
) -> tuple[dict[str, AnyArray], AnyArray]:
    """Decodes a mesh compressed by Draco. Returns its attributes (V, C) by name, and the vertex indices of
    its faces (3 F, 1).

    Args:
        data: the content of the extension's buffer view.
        attributes: the number of each attribute in the compressed mesh.
        where: the name of the file, for the message about a missing decoder.

    Raises:
        InputError: if the bytes are damaged, or lack an attribute.
        ResourceError: if the decoder is not installed.
    """
    decoder = load_decoder("DracoPy", where)
    try:
        mesh = decoder.decode(data)
        arrays_by_id: dict[int, Any] = {
            attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes
        }
        faces = np.asarray(mesh.faces, np.uint32).reshape(-1, 1)
    except Exception:  # Third-party decoders may raise any exception for damaged data.
        raise InputError(f"the mesh data compressed by {DRACO} is damaged") from None
    lacking = [name for name, number in attributes.items() if number not in arrays_by_id]
    if lacking:
        raise InputError(
            f"these attributes are missing in the mesh data compressed by {DRACO}: {', '.join(lacking[:5])}"
        )
    arrays = {name: np.asarray(arrays_by_id[number]) for name, number in attributes.items()}
    return {name: array.reshape(len(array), -1) for name, array in arrays.items()}, faces


def check_meshopt(packed: Entry) -> int:
    """Checks the numbers in the extension of a compressed buffer view. Returns the declared number of
    decompressed bytes.

    Raises:
        InputError: if the extension does not allow these numbers.
    """
    count, size, mode = packed.count, packed.byteStride, packed.mode
    filtered = "NONE" if packed.filter is None else packed.filter
    whole = all(isinstance(value, int) and not isinstance(value, bool) for value in (count, size))
    if not whole or mode not in _MODES or filtered not in _FILTERS or count < 1:
        raise InputError("the count, size, mode or filter of the compressed data is missing or unknown")
    if mode == "ATTRIBUTES":
        fits = 0 < size <= _MAX_ROW_BYTES and size % 4 == 0
        fits &= filtered not in ("OCTAHEDRAL", "COLOR") or size in (4, 8)
        fits &= filtered != "QUATERNION" or size == 8
    else:
        fits = size in (2, 4) and filtered == "NONE" and (mode == "INDICES" or count % 3 == 0)
    if not fits:
        raise InputError(
            f"a row size of {size} bytes does not match the mode and filter of the compressed data"
        )
    return int(count * size)


def meshopt_bytes(data: bytes, packed: Entry, where: str = "") -> bytes:
    """Returns the bytes of a buffer view that meshoptimizer packed into ``data``.

    Args:
        where: the name of the file, for the message about a missing decoder.

    Raises:
        InputError: if :func:`check_meshopt` refuses the numbers, or the bytes are damaged.
        ResourceError: if the decoder is not installed.
    """
    size = check_meshopt(packed)
    decoder = load_decoder("meshopt", where)
    try:
        coding = packed.mode, packed.filter or "NONE"
        decoded = decoder.decode_gltf_buffer(data, packed.count, packed.byteStride, *coding)
        unpacked = np.ascontiguousarray(decoded).tobytes()
    except Exception:  # Third-party decoders may raise any exception for damaged data.
        raise InputError("the compressed data is damaged") from None
    if len(unpacked) != size:
        raise InputError("the compressed data is damaged")
    return unpacked


def load_decoder(module: str, where: str) -> Any:
    """Returns the library that decodes one kind of compression. Only compressed files load it.

    Raises:
        ResourceError: if it is not installed, or does not load.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        is_missing = isinstance(error, ModuleNotFoundError) and error.name == module
        state = "is not installed" if is_missing else "cannot be loaded"
        problem = f"the file is compressed, but the library {module}, which decompresses it, {state}"
        advice = (
            'Type: pip install "enliven[compressed]" (in a checkout: pip install "./shared[compressed]").'
        )
        raise ResourceError(problem, where=where, remedy=advice) from None
