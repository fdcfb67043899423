"""Collects the materials of a glTF file with their encoded textures."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from enliven.arrays import Float, Float32, Int32
from enliven.errors import InputError, find_plain_reason
from enliven.files import DAMAGE
from enliven.meshes.gltf.file import GltfFile
from enliven.meshes.gltf.gltf_json import Entry
from enliven.meshes.materials import MeshMaterials, Texture, textures_in

_MAX_IMAGE_BYTES = 1 << 28
"""Maximum total bytes of all encoded images of a file. Detailed characters have a tenth of this amount. A
limit is needed because a file can reference one small buffer as an image thousands of times."""
_MAX_TEXTURE_SETS = 4
"""Maximum number of sets of texture coordinates. One or two are usual."""

Corners = tuple[Float32, Float32 | None]
"""The vertex attributes of a primitive: (V, S, 2) texture coordinates, and (V, 4) linear vertex colours or
None for white."""


class Materials:
    """The materials that primitives use, in order of first use.

    Attributes:
        notes: sentences about textures that were left out.
    """

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._known: dict[int, int] = {}
        self._textures: dict[int, int | None] = {}
        self._bytes = 0
        self.definitions = list[str]()
        self.textures = list[Texture]()
        self.notes = list[str]()

    def number(self, primitive: Any) -> int:
        """Returns the number of a primitive's material, or -1 for none."""
        material_number = primitive.material
        if not isinstance(material_number, int) or not 0 <= material_number < len(
            self._file.document.materials
        ):
            return -1
        if material_number not in self._known:
            self._known[material_number] = self._store_material(material_number)
        return self._known[material_number]

    def corners(self, primitive: Any, count: int) -> Corners:
        """Returns the texture coordinates and the colours of a primitive's vertices, as far as its material
        uses them."""
        attributes, sets, material_number = primitive.attributes, list[Float32](), self.number(primitive)
        textured = material_number >= 0 and bool(textures_in(json.loads(self.definitions[material_number])))
        for number in range(_MAX_TEXTURE_SETS if textured else 0):
            accessor_number = getattr(attributes, f"TEXCOORD_{number}", None)
            if accessor_number is None:
                break
            sets.append(_read_rows(self._file, accessor_number, count, 2))
        uvs = np.stack(sets, 1) if sets else np.zeros((count, 0, 2), np.float32)
        if material_number < 0 or getattr(attributes, "COLOR_0", None) is None:
            return uvs, None
        return uvs, _read_rows(self._file, attributes.COLOR_0, count, 4)

    def join_materials_of_parts(self, parts: Sequence[tuple[Int32, int, Corners]]) -> MeshMaterials | None:
        """Joins the materials of all parts. Each part is given as (faces (F, 3), material number,
        corners).
        """
        if not self.definitions:
            return None
        sets = max(uvs.shape[1] for _, _, (uvs, _) in parts)
        tinted = any(tint is not None for _, _, (_, tint) in parts)
        numbers, uv_parts, tints = list[Int32](), list[Float32](), list[Float32]()
        for faces, material, (uvs, tint) in parts:
            padded_uvs = np.zeros((len(uvs), sets, 2), np.float32)
            padded_uvs[:, : uvs.shape[1]] = uvs
            numbers.append(np.full(len(faces), material, np.int32))
            uv_parts.append(padded_uvs[faces])
            tints.append((np.ones((len(uvs), 4), np.float32) if tint is None else tint)[faces])
        all_tints = np.concatenate(tints) if tinted else None
        collected = tuple(self.definitions), tuple(self.textures)
        return MeshMaterials(*collected, np.concatenate(numbers), np.concatenate(uv_parts), all_tints)

    def _store_material(self, at: int) -> int:
        """Stores a material and its textures. Returns its number, or -1 if it is damaged."""
        value = _convert_to_plain_json(self._file.document.materials[at])
        try:
            for number in set(textures_in(value)):
                if number not in self._textures:
                    self._textures[number] = self._store_texture(number)
            self.definitions.append(json.dumps(self._renumber_json(value), sort_keys=True, allow_nan=False))
        except (InputError, *DAMAGE) as error:
            self.notes.append(
                f"material {at} cannot be read ({find_plain_reason(error)}), so only its colour is used"
            )
            return -1
        return len(self.definitions) - 1

    def _renumber_json(self, value: Any, in_extensions: bool = False) -> Any:
        """Returns the JSON of a material with renumbered textures. Textures that were left out are removed.

        Args:
            in_extensions: True if the keys of the value are names of extensions.
        """
        if isinstance(value, list):
            return [self._renumber_json(item) for item in value]
        if not isinstance(value, dict):
            return value
        renumbered = dict[str, Any]()
        for key, item in value.items():
            renumbered[key] = self._renumber_json(item, key == "extensions")
            if key.endswith("Texture") and isinstance(item, dict):
                number = self._textures[item["index"]]
                if number is None:
                    del renumbered[key]
                else:
                    renumbered[key]["index"] = number
            # Remove empty objects, but keep an empty extension, because its presence alone has a meaning.
            elif not in_extensions and _is_empty(renumbered[key]):
                del renumbered[key]
        return renumbered

    def _store_texture(self, number: int) -> int | None:
        """Stores a texture and returns its number. If the texture cannot be stored, adds a note and returns
        None."""
        try:
            texture = _find_entry(self._file.document.textures, number)
            packed = [name for name in vars(texture.extensions or Entry({})) if name.partition("_")[2]]
            if texture.source is None and packed:
                raise InputError(f"the image is stored by the unsupported extension {packed[0][:60]}")
            image = _find_entry(self._file.document.images, texture.source)
            if image.bufferView is not None:
                data = self._file.data_of_view(image.bufferView)
            else:
                data = self._file.data_of_uri(image.uri)
            self._bytes += len(data)
            if self._bytes > _MAX_IMAGE_BYTES:
                raise InputError(f"the images have more than {_MAX_IMAGE_BYTES} bytes in total")
            sampler = texture.sampler
            sampler_text = (
                ""
                if sampler is None
                else json.dumps(_convert_to_plain_json(_find_entry(self._file.document.samplers, sampler)))
            )
            kept_texture = Texture(np.frombuffer(data, np.uint8), sampler_text)
        except (InputError, *DAMAGE) as error:
            self.notes.append(f"texture {number} is ignored ({find_plain_reason(error)})")
            return None
        self.textures.append(kept_texture)
        return len(self.textures) - 1


def _is_empty(value: Any) -> bool:
    return value is None or (isinstance(value, (dict, list, str)) and not value)


def _find_entry(entries: list[Any] | None, number: int) -> Any:
    """Returns an entry of a list of the document.

    Raises:
        LookupError: if it is missing.
    """
    if not entries or not 0 <= number < len(entries):
        raise LookupError(f"entry {number} does not exist")
    return entries[number]


def _convert_to_plain_json(value: Any) -> Any:
    """Returns a value of the document as plain JSON."""
    if isinstance(value, Entry):
        return {name: _convert_to_plain_json(item) for name, item in vars(value).items()}
    return [_convert_to_plain_json(item) for item in value] if isinstance(value, list) else value


def _read_rows(file: GltfFile, accessor: int, count: int, width: int) -> Float32:
    """Returns (count, width) float32 values of an accessor. Missing columns are filled with 1.

    Raises:
        InputError: if the accessor does not have ``count`` rows.
    """
    values: Float = np.nan_to_num(np.asarray(file.accessor(accessor), np.float64))
    if len(values) != count:
        raise file.create_error(
            f"the mesh has {len(values)} texture coordinates or colours for {count} vertices"
        )
    rows = np.ones((count, width), np.float32)
    shown = min(width, values.shape[1])
    rows[:, :shown] = values[:, :shown]
    return rows
