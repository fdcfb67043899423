"""A glTF or GLB file: its node tree and its accessors, checked, in every packing that glTF 2.0 allows."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.errors import InputError
from enliven.files import DAMAGE, Beside, read_file
from enliven.formats.gltf.vrm import human_bones
from enliven.meshes import GLTF_SUFFIXES, Entry, gltf_document

_TYPES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Components of each accessor type (glTF 2.0, table 3.6.2.2)."""
_COMPONENTS: dict[int, Any] = {
    5120: np.int8,
    5121: np.uint8,
    5122: np.int16,
    5123: np.uint16,
    5125: np.uint32,
    5126: np.float32,
}
"""NumPy type of each component type (glTF 2.0, section 3.6.2.2)."""
_KNOWN_EXTENSIONS = {"KHR_mesh_quantization", "KHR_materials_unlit", "KHR_texture_transform"}


class GltfFile:
    """A parsed file with its buffers.

    Attributes:
        path: named in errors.
        document: its JSON; what it does not state is None.
        parents: of each node, -1 at a root.

    Raises:
        InputError: where the file cannot be read, is cut short, or needs an extension that is not known.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.document, self.parents, self._blob = _parsed(self.path)
        self._human = human_bones(self.document)
        self._beside = Beside(self.path)
        self._buffers: dict[int, bytes] = {}
        needed = set(self.document.extensionsRequired or []) - _KNOWN_EXTENSIONS
        if needed:
            mend = "Export it without, for example without compression."
            raise self.wrong(f"it needs {', '.join(sorted(needed))}, which is not known here", mend)

    def wrong(self, what: str, mend: str = "Export the model again.") -> InputError:
        """Returns an error that names the file."""
        return InputError(what, where=str(self.path), mend=mend)

    def name(self, node: int) -> str:
        """Returns a node's name; a nameless node gets its number.

        A human bone of a VRM has its name in VRM's map, which every tool knows, whatever the node is called.
        """
        return self._human.get(node) or str(self.document.nodes[node].name or f"joint {node}")

    def accessor(self, index: int) -> AnyArray:
        """Returns (N, C) the elements of an accessor: sparse ones filled in, normalised integers as -1..1 or
        0..1."""
        return np.asarray(self._guarded(self._accessor, index, f"accessor {index}"))

    def data_of_view(self, view: int) -> bytes:
        """The bytes of a buffer view, such as an image."""
        return bytes(self._guarded(self._view_bytes, view, f"buffer view {view}"))

    def _guarded(self, read: Callable[[int], Any], index: int, what: str) -> Any:
        """Returns what ``read`` gives; its exceptions become an error that names the file."""
        try:
            return read(index)
        except InputError:
            raise
        except Exception as error:  # numbers that point outside raise whatever they like
            raise self.wrong(f"{what} cannot be read: {error or type(error).__name__}") from None

    def _accessor(self, index: int) -> AnyArray:
        accessor = self.document.accessors[index]
        kind, width = np.dtype(_COMPONENTS[accessor.componentType]), _TYPES[accessor.type]
        if accessor.bufferView is None:
            values = np.zeros((accessor.count, width), kind)
        else:
            values = self._strided(accessor.bufferView, accessor.byteOffset or 0, kind, accessor.count, width)
        if accessor.sparse is not None:
            values = values.copy()
            sparse = accessor.sparse
            number = np.dtype(_COMPONENTS[sparse.indices.componentType])
            at = self._strided(
                sparse.indices.bufferView, sparse.indices.byteOffset or 0, number, sparse.count, 1
            )
            start = sparse.values.byteOffset or 0
            values[at[:, 0]] = self._strided(sparse.values.bufferView, start, kind, sparse.count, width)
        if accessor.normalized and kind.kind in "iu":
            return np.maximum(values / np.iinfo(kind).max, -1.0)
        return values

    def _strided(self, view: int, offset: int, kind: np.dtype[Any], count: int, width: int) -> AnyArray:
        """(count, width) elements of a buffer view, packed or interleaved."""
        found = self.document.bufferViews[view]
        data = self._view_bytes(view)
        size = kind.itemsize * width
        stride = found.byteStride or size
        if count and offset + (count - 1) * stride + size > len(data):
            raise self.wrong("an accessor reaches beyond its buffer: the file is cut short or damaged")
        if not count:
            return np.zeros((0, width), kind)
        shape, steps = (count, width), (stride, kind.itemsize)
        return np.ndarray(shape, kind.newbyteorder("<"), data, offset, steps).astype(kind)

    def _view_bytes(self, view: int) -> bytes:
        found = self.document.bufferViews[view]
        start = found.byteOffset or 0
        data = self._buffer(found.buffer)[start : start + found.byteLength]
        if len(data) < found.byteLength:
            raise self.wrong("a buffer is shorter than the file says: it is cut short or damaged")
        return data

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            uri = self.document.buffers[index].uri
            data = self._blob if uri is None else self.data_of_uri(uri)
            if data is None:
                raise self.wrong("the bytes that belong into the file are missing")
            self._buffers[index] = bytes(data)
        return self._buffers[index]

    def data_of_uri(self, uri: str) -> bytes:
        """The bytes of a data URI, or of a file beside this one: see :class:`enliven.files.Beside`."""
        return self._beside.uri(uri)


def matrices_of(translation: AnyArray, rotation: AnyArray, scale: AnyArray) -> Float:
    """(..., 4, 4) translation after rotation after scale; rotations (..., 4) are (x, y, z, w)."""
    x, y, z, w = np.moveaxis(np.asarray(rotation, np.float64), -1, 0)
    made = np.zeros((*x.shape, 4, 4))
    made[..., 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1)
    made[..., 1, :3] = np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1)
    made[..., 2, :3] = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1)
    made[..., :3, :3] *= np.asarray(scale, np.float64)[..., None, :]
    made[..., :3, 3] = translation
    made[..., 3, 3] = 1.0
    return made


def _parsed(path: Path) -> tuple[Entry, list[int], bytes | None]:
    """Parses the document, the parents of its nodes and the bytes of a GLB; raises one clear message."""
    if path.suffix.lower() not in GLTF_SUFFIXES and path.is_file():
        raise InputError("it is no glTF file", where=str(path), mend="Give a .glb, .gltf or .vrm file.")
    data = read_file(path)
    try:
        found = gltf_document(data)
        if found[0].asset is None or not str(found[0].asset.version).startswith("2."):
            raise ValueError("not glTF 2")
    except DAMAGE as error:
        logging.getLogger(__name__).debug("glTF", exc_info=True)
        reason = str(error).strip().splitlines()
        what = f"it cannot be read as glTF 2: {reason[0][:200] if reason else type(error).__name__}"
        raise InputError(what, where=str(path), mend="Is it whole, and of the kind it says?") from None
    return found
