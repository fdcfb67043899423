"""A glTF or GLB file: its node tree and its checked accessors. It supports all layouts of accessors that glTF
2.0 allows."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.errors import EnlivenError, InputError, find_plain_reason
from enliven.files import DAMAGE, ReferencedFiles, is_file, read_file
from enliven.meshes.gltf.compression import MAX_UNPACKED_BYTES, check_meshopt, draco_arrays, meshopt_bytes
from enliven.meshes.gltf.extensions import DRACO, MESHOPT, extension_notes, find_hidden_nodes, follow_pointers
from enliven.meshes.gltf.gltf_json import GLTF_SUFFIXES, Entry, gltf_document
from enliven.meshes.gltf.vrm import read_human_bones

_COMPONENT_COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Components of each accessor type (glTF 2.0, table 3.6.2.2)."""
_COMPONENT_DTYPES: dict[int, Any] = {
    5120: np.int8,
    5121: np.uint8,
    5122: np.int16,
    5123: np.uint16,
    5125: np.uint32,
    5126: np.float32,
}
"""NumPy type of each component type (glTF 2.0, section 3.6.2.2)."""
_EXPORT_ADVICE = "Export the model again."
"""The remedy that the error message for a damaged model suggests."""


class GltfFile:
    """A parsed file with its buffers.

    Attributes:
        path: the path of the file. Error messages contain it.
        document: the JSON of the file. Missing entries are None.
        parents: parent of each node, -1 at a root.
        hidden: the nodes that the file hides.
        notes: a sentence about each ignored extension and animation.

    Raises:
        InputError: if the file cannot be read, is truncated, or needs an unsupported extension.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.document, self.parents, self._blob = _parse_document(self.path)
        self._human = read_human_bones(self.document)
        self._beside = ReferencedFiles(self.path)
        self._buffers: dict[int, bytes] = {}
        self._decoded: dict[int, AnyArray] = {}
        self._unpacked: dict[int, bytes] = {}
        self._unpacked_bytes = 0
        try:
            self.notes = extension_notes(self.document)
            _check_references(self.document)
            self.notes += follow_pointers(self.document)
            self.hidden = find_hidden_nodes(self.document, self.parents)
        except InputError as error:
            raise self.create_error(error.what, error.remedy or _EXPORT_ADVICE) from None
        except DAMAGE as error:
            raise self.create_damage_error(error) from None

    def create_error(self, what: str, remedy: str = _EXPORT_ADVICE) -> InputError:
        """Returns an InputError with the path of the file and the problem ``what``."""
        return InputError(what, where=str(self.path), remedy=remedy)

    def create_damage_error(self, error: Exception) -> InputError:
        """Converts an exception that was caused by a damaged file into an InputError."""
        logging.getLogger(__name__).debug("glTF", exc_info=error)
        return self.create_error(f"the file is damaged: {find_plain_reason(error)}")

    def keys(self, sampler: Any, path: str) -> Float:
        """Returns the values (K, C) of a sampler at its K keys. For cubic interpolation, returns values and
        tangents (3 K, C).

        Raises:
            InputError: if the number or the width of the values is wrong, or a value is not finite.
        """
        values = np.asarray(self.accessor(sampler.output), np.float64)
        values_per_key = 3 if sampler.interpolation == "CUBICSPLINE" else 1
        count = self.document.accessors[sampler.input].count
        fits = values.shape == (values_per_key * count, 4 if path == "rotation" else 3) and count > 0
        if not fits or not np.isfinite(values).all():
            raise self.create_error(
                f"the animation of a node's {path} has {len(values)} values for {count} times, or "
                "invalid values"
            )
        return values

    @cached_property
    def scale_keys(self) -> dict[int, dict[int, Float]]:
        """Returns the scales (K, 3) at the keys of each node with an animated scale. The keys of the
        dictionary are the node and the number of the animation."""
        keys_by_node: dict[int, dict[int, Float]] = {}
        for number, animation in enumerate(self.document.animations):
            for channel in animation.channels or []:
                if channel.target.path != "scale" or channel.target.node is None:
                    continue
                sampler = animation.samplers[channel.sampler]
                values = self.keys(sampler, "scale")
                points = values[1::3] if sampler.interpolation == "CUBICSPLINE" else values
                keys_by_node.setdefault(channel.target.node, {})[number] = points
        return keys_by_node

    def decompress(self, primitive: Any) -> None:
        """Decodes the accessors of a primitive that Draco compressed."""
        packed = getattr(primitive.extensions, DRACO, None)
        if packed is None:
            return
        accessor_numbers = {
            name: accessor_number
            for name, accessor_number in vars(packed.attributes).items()
            if isinstance(accessor_number, int)
        }
        try:
            arrays, faces = draco_arrays(
                self.data_of_view(packed.bufferView), accessor_numbers, str(self.path)
            )
        except InputError as error:
            raise self.create_error(error.what) from None
        arrays_by_accessor = {vars(primitive.attributes)[name]: array for name, array in arrays.items()}
        if primitive.indices is not None:
            arrays_by_accessor[primitive.indices] = faces
        for index, array in arrays_by_accessor.items():
            accessor = self.document.accessors[index]
            if array.shape != (accessor.count, _COMPONENT_COUNTS[accessor.type]):
                raise self.create_error(
                    f"the data compressed by {DRACO} does not match the size of accessor {index}"
                )
            self._decoded[index] = array.astype(_COMPONENT_DTYPES[accessor.componentType])

    def name(self, node: int) -> str:
        """Returns a node's name. A nameless node gets its number.

        A human bone of a VRM file gets its name from VRM's humanoid map instead of the node's name, because
        every tool knows these names.
        """
        return self._human.get(node) or str(self.document.nodes[node].name or f"joint {node}")

    def accessor(self, index: int) -> AnyArray:
        """Returns the elements (N, C) of an accessor.

        Sparse elements are filled in. Normalised integers become -1..1 or 0..1.
        """
        return np.asarray(self._read_guarded(self._read_accessor, index, f"accessor {index}"))

    def data_of_view(self, view: int) -> bytes:
        """Returns the bytes of a buffer view, such as an image."""
        return bytes(self._read_guarded(self._view_bytes, view, f"buffer view {view}"))

    def _read_guarded(self, read: Callable[[int], Any], index: int, what: str) -> Any:
        """Returns ``read(index)``. Converts any exception into an InputError that contains the name of the
        file and ``what`` was read."""
        try:
            return read(index)
        except EnlivenError:
            raise
        except Exception as error:  # Numbers out of range may raise any exception.
            raise self.create_error(f"{what} cannot be read: {find_plain_reason(error)}") from None

    def _read_accessor(self, index: int) -> AnyArray:
        accessor = self.document.accessors[index]
        kind, width = np.dtype(_COMPONENT_DTYPES[accessor.componentType]), _COMPONENT_COUNTS[accessor.type]
        if index in self._decoded:
            values = self._decoded[index]
        elif accessor.bufferView is None:
            values = np.zeros((accessor.count, width), kind)
        else:
            values = self._read_strided(
                accessor.bufferView, accessor.byteOffset or 0, kind, accessor.count, width
            )
        if accessor.sparse is not None:
            values = values.copy()
            sparse = accessor.sparse
            number = np.dtype(_COMPONENT_DTYPES[sparse.indices.componentType])
            sparse_indices = self._read_strided(
                sparse.indices.bufferView, sparse.indices.byteOffset or 0, number, sparse.count, 1
            )
            start = sparse.values.byteOffset or 0
            values[sparse_indices[:, 0]] = self._read_strided(
                sparse.values.bufferView, start, kind, sparse.count, width
            )
        if accessor.normalized and kind.kind in "iu":
            return np.maximum(values / np.iinfo(kind).max, -1.0)
        return values

    def _read_strided(self, view: int, offset: int, kind: np.dtype[Any], count: int, width: int) -> AnyArray:
        """Returns (count, width) elements of a buffer view, packed or interleaved."""
        view_entry = self.document.bufferViews[view]
        data = self._view_bytes(view)
        size = kind.itemsize * width
        stride = view_entry.byteStride or size
        if count and offset + (count - 1) * stride + size > len(data):
            raise self.create_error(
                "an accessor reads beyond the end of its buffer, so the file is truncated or damaged"
            )
        if not count:
            return np.zeros((0, width), kind)
        shape, steps = (count, width), (stride, kind.itemsize)
        return np.ndarray(shape, kind.newbyteorder("<"), data, offset, steps).astype(kind)

    def _view_bytes(self, view: int) -> bytes:
        view_entry = self.document.bufferViews[view]
        for extension in MESHOPT:
            packed = getattr(view_entry.extensions, extension, None)
            if isinstance(packed, Entry):
                return self._decompress_view(view, packed, extension)
        return self._count_declared_bytes(view_entry)

    def _count_declared_bytes(self, found: Any) -> bytes:
        """Returns the bytes that a buffer view declares. The JSON entry of a compressed view has the same
        format.
        """
        start = found.byteOffset or 0
        data = self._buffer_bytes(found.buffer)[start : start + found.byteLength]
        if len(data) < found.byteLength:
            raise self.create_error(
                "a buffer is shorter than its declared length, so the file is truncated or damaged"
            )
        return data

    def _decompress_view(self, view: int, packed: Entry, extension: str) -> bytes:
        """Returns the bytes of a buffer view that meshoptimizer compressed. Each view is decompressed only
        once.
        """
        if view not in self._unpacked:
            try:
                self._unpacked_bytes += check_meshopt(packed)
                if self._unpacked_bytes > MAX_UNPACKED_BYTES:
                    raise InputError(
                        f"the decompressed data has more than {MAX_UNPACKED_BYTES} bytes in total"
                    )
                self._unpacked[view] = meshopt_bytes(
                    self._count_declared_bytes(packed), packed, str(self.path)
                )
            except InputError as error:
                if error.where == str(self.path):
                    raise
                problem = f"buffer view {view}, compressed by {extension}, cannot be read: {error.what}"
                raise self.create_error(problem) from None
        return self._unpacked[view]

    def _buffer_bytes(self, index: int) -> bytes:
        if index not in self._buffers:
            uri = self.document.buffers[index].uri
            data = self._blob if uri is None else self.data_of_uri(uri)
            if data is None:
                raise self.create_error("the binary data of the file is missing")
            self._buffers[index] = bytes(data)
        return self._buffers[index]

    def data_of_uri(self, uri: str) -> bytes:
        """Returns the bytes of a data URI, or of a file next to this one: see
        :class:`enliven.files.ReferencedFiles`."""
        return self._beside.read_uri(uri)


def compose_matrices(translation: AnyArray, rotation: AnyArray, scale: AnyArray) -> Float:
    """Composes (..., 4, 4) transforms that scale first, then rotate, then translate. Rotations (..., 4) are
    quaternions (x, y, z, w).
    """
    x, y, z, w = np.moveaxis(np.asarray(rotation, np.float64), -1, 0)
    matrices = np.zeros((*x.shape, 4, 4))
    matrices[..., 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1)
    matrices[..., 1, :3] = np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1)
    matrices[..., 2, :3] = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1)
    matrices[..., :3, :3] *= np.asarray(scale, np.float64)[..., None, :]
    matrices[..., :3, 3] = translation
    matrices[..., 3, 3] = 1.0
    return matrices


def _parse_document(path: Path) -> tuple[Entry, list[int], bytes | None]:
    """Parses the file. Returns the document, the parent of each node, and the binary chunk of a GLB. Any
    error becomes an InputError with a message for the user.
    """
    if path.suffix.lower() not in GLTF_SUFFIXES and is_file(path):
        raise InputError(
            "the file is not a glTF file", where=str(path), remedy="Choose a .glb, .gltf or .vrm file."
        )
    data = read_file(path)
    if not data:
        raise InputError("the file is empty", where=str(path), remedy=_EXPORT_ADVICE)
    try:
        parsed = gltf_document(data)
        version = None if parsed[0].asset is None else parsed[0].asset.version
        if not str(version).startswith("2."):
            raise InputError(
                "the file declares another glTF version" if version else "the file declares no glTF version"
            )
    except (InputError, *DAMAGE) as error:
        logging.getLogger(__name__).debug("glTF", exc_info=True)
        problem = f"the file cannot be read as glTF 2: {find_plain_reason(error)}"
        raise InputError(
            problem,
            where=str(path),
            remedy="Check that the file is complete and has the correct file extension.",
        ) from None
    return parsed


def _check_references(document: Entry) -> None:
    """Checks that nodes, skins and animations refer only to existing entries.

    Raises:
        InputError: if a reference is invalid. The message describes the first invalid reference.
    """
    nodes, skins = document.nodes, document.skins
    used = {node.skin for node in nodes}
    for number, node in enumerate(nodes):
        for kind, index, entries in (("mesh", node.mesh, document.meshes), ("skin", node.skin, skins)):
            if index is not None and not _is_number(index, len(entries)):
                raise InputError(f"node {number} refers to the {kind} {index!s:.20}, which does not exist")
    for number, skin in enumerate(skins):
        missing_joints = [joint for joint in skin.joints or [] if not _is_number(joint, len(nodes))]
        if missing_joints:
            raise InputError(
                f"skin {number} refers to the joint {missing_joints[0]!s:.20}, which is not a node"
            )
        if number in used and not skin.joints:
            raise InputError(f"skin {number} has no joints")
    for number, animation in enumerate(document.animations):
        for channel in animation.channels or []:
            target = channel.target
            if target is None or not _is_number(channel.sampler, len(animation.samplers or [])):
                raise InputError(f"a channel of animation {number} has no target or no keyframes")
            if target.node is not None and not _is_number(target.node, len(nodes)):
                raise InputError(f"animation {number} moves node {target.node!s:.20}, which does not exist")


def _is_number(value: Any, count: int) -> bool:
    """Returns True if a JSON value is a valid index into a list of ``count`` entries."""
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < count
