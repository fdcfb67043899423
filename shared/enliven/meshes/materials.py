"""The materials of a mesh with encoded textures, in the form of glTF 2.0, and its texture coordinates.

Images and materials are not decoded: an image is stored as the bytes of its file, and a material as its JSON
text. Texture coordinates are stored per face corner, not per vertex, so vertices can be welded safely.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from enliven.arrays import AnyArray, Bool, Float, Float32, Int, Int32, UInt8
from enliven.errors import InputError

_EXPORT_ADVICE = "Export the model again."
"""The remedy that the error message for a damaged material suggests."""


@dataclass(frozen=True, eq=False)
class Texture:
    """An encoded image and its sampler.

    Attributes:
        image: (N,) the bytes of a PNG or JPEG file.
        sampler: the JSON text of a glTF sampler, or "" if there is none.
    """

    image: UInt8
    sampler: str = ""

    def __post_init__(self) -> None:
        if not self.kind:
            raise InputError(
                "a texture is neither a PNG nor a JPEG image", where="materials", remedy=_EXPORT_ADVICE
            )
        if self.sampler:
            _material_object(self.sampler)

    @property
    def kind(self) -> str:
        """The image's media type, from its first bytes, or "" for a type that glTF does not allow."""
        head = np.asarray(self.image, np.uint8)[:8].tobytes()
        return "image/png" if head == b"\x89PNG\r\n\x1a\n" else "image/jpeg" * (head[:3] == b"\xff\xd8\xff")


@dataclass(frozen=True, eq=False)
class MeshMaterials:
    """The materials and the texture coordinates of a mesh, for each face.

    Attributes:
        definitions: JSON objects of glTF materials. They refer to textures by their number in ``textures``.
        textures: the textures of the materials.
        of: (F,) int32 the material of each face, or -1 for none. A face without material shows only its
            vertex colours.
        uvs: (F, 3, S, 2) float32, the S sets of texture coordinates of each corner.
        tints: (F, 3, 4) float32, the linear colour and opacity of each corner. They are multiplied with the
            material's colours. None for white.

    Raises:
        InputError: if the shapes or numbers of the arrays do not match.
    """

    definitions: tuple[str, ...]
    textures: tuple[Texture, ...]
    of: Int32
    uvs: Float32
    tints: Float32 | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "of", np.ascontiguousarray(self.of, np.int32))
        object.__setattr__(self, "uvs", np.ascontiguousarray(self.uvs, np.float32))
        if self.tints is not None:
            object.__setattr__(self, "tints", np.ascontiguousarray(self.tints, np.float32))
        faces, problem = len(self.of), ""
        for material in self.definitions:
            texture_numbers = textures_in(_material_object(material))
            if texture_numbers and not 0 <= min(texture_numbers) <= max(texture_numbers) < len(self.textures):
                problem = (
                    f"a material refers to texture {max(texture_numbers)}, but only {len(self.textures)} "
                    "textures exist"
                )
        if self.uvs.ndim != 4 or self.uvs.shape[:2] != (faces, 3) or self.uvs.shape[3] != 2:
            problem = f"the texture coordinates have the shape {self.uvs.shape}, expected ({faces}, 3, S, 2)"
        elif self.tints is not None and self.tints.shape != (faces, 3, 4):
            problem = f"the corner colours have the shape {self.tints.shape}, expected ({faces}, 3, 4)"
        elif faces and not -1 <= self.of.min() <= self.of.max() < len(self.definitions):
            problem = f"a face refers to a material outside 0..{len(self.definitions) - 1}"
        elif not (np.isfinite(self.uvs).all() and (self.tints is None or np.isfinite(self.tints).all())):
            problem = "a texture coordinate or a corner colour is not a finite number"
        if problem:
            raise InputError(problem, where="materials", remedy=_EXPORT_ADVICE)

    def select_faces(self, faces: Int | Bool) -> MeshMaterials:
        """Returns the materials of the selected ``faces`` (numbers or mask)."""
        tints = None if self.tints is None else self.tints[faces]
        return replace(self, of=self.of[faces], uvs=self.uvs[faces], tints=tints)

    def flip_faces(self, which: Bool) -> MeshMaterials:
        """Returns the materials for a mesh in which the faces of the mask ``which`` (F,) are flipped: their
        corners are in reverse order."""
        uvs = np.where(which[:, None, None, None], self.uvs[:, ::-1], self.uvs)
        tints = self.tints
        if tints is not None:
            tints = np.where(which[:, None, None], tints[:, ::-1], tints)
        return replace(self, uvs=uvs, tints=tints)

    def interpolate_within(self, faces: Int, barycentric: Float) -> MeshMaterials:
        """Returns the materials of K new faces that lie within old faces.

        Args:
            faces: (K,) the old face that contains each new face. -1 for none: the new face gets no material.
            barycentric: (K, 3, 3) barycentric coordinates of each new corner in the old face.
        """
        if not len(self.of):
            none = join_materials([(self, 0), (None, len(faces))])
            assert none is not None
            return none
        inside = faces >= 0

        def spread(old: Float32) -> Float32:
            blended = np.einsum("kab,kb...->ka...", barycentric, old[faces].astype(np.float64))
            return np.asarray(np.where(inside.reshape(-1, *[1] * (old.ndim - 1)), blended, 0.0), np.float32)

        tints = None if self.tints is None else spread(self.tints)
        of = np.where(inside, self.of[faces], -1).astype(np.int32)
        return replace(self, of=of, uvs=spread(self.uvs), tints=tints)


def join_materials(groups: Sequence[tuple[MeshMaterials | None, int]]) -> MeshMaterials | None:
    """Joins the materials of consecutive groups of faces. Each group is a pair of its materials and its
    number of faces.

    Equal materials and textures are merged. Returns None if no group has materials.
    """
    if all(group is None for group, _ in groups):
        return None
    textures: dict[tuple[bytes, str], tuple[int, Texture]] = {}
    materials: dict[str, int] = {}
    sets = max(group.uvs.shape[2] for group, _ in groups if group is not None)
    tinted = any(group is not None and group.tints is not None for group, _ in groups)
    of, uvs, tints = list[Int32](), list[Float32](), list[Float32]()
    for group, count in groups:
        material_numbers: Int32 = np.full(count, -1, np.int32)
        padded_uvs = np.zeros((count, 3, sets, 2), np.float32)
        tint = np.ones((count, 3, 4), np.float32)
        if group is not None:
            texture_of = [
                textures.setdefault((t.image.tobytes(), t.sampler), (len(textures), t))[0]
                for t in group.textures
            ]
            definitions = [
                renumber_textures(material, texture_of.__getitem__) for material in group.definitions
            ]
            number = np.array(
                [*(materials.setdefault(text, len(materials)) for text in definitions), -1], np.int32
            )
            material_numbers, padded_uvs[:, :, : group.uvs.shape[2]] = number[group.of], group.uvs
            tint = tint if group.tints is None else group.tints
        of.append(material_numbers)
        uvs.append(padded_uvs)
        tints.append(tint)
    all_textures = tuple(texture for _, texture in textures.values())
    all_tints = np.concatenate(tints) if tinted else None
    return MeshMaterials(tuple(materials), all_textures, np.concatenate(of), np.concatenate(uvs), all_tints)


def textures_in(material: Any) -> list[int]:
    """Returns the numbers of all textures that a material refers to, also in extensions."""
    numbers = list[int]()
    _replace_texture_numbers(material, lambda number: numbers.append(number) or number)
    return numbers


def renumber_textures(material: str, number: Callable[[int], int]) -> str:
    """Returns the JSON text of a material, with each texture number replaced by ``number`` of it."""
    value = _material_object(material)
    _replace_texture_numbers(value, number)
    return json.dumps(value, sort_keys=True, allow_nan=False)


def _replace_texture_numbers(value: Any, number: Callable[[int], int]) -> None:
    """Replaces every texture number in a JSON value by the result of ``number``."""
    for key, item in value.items() if isinstance(value, dict) else enumerate(value):
        if isinstance(key, str) and key.endswith("Texture") and isinstance(item, dict):
            texture_number = item.get("index")
            if not isinstance(texture_number, int) or isinstance(texture_number, bool):
                raise InputError(
                    f"the property {key} of a material does not contain a texture number", where="materials"
                )
            item["index"] = number(texture_number)
        if isinstance(item, (dict, list)):
            _replace_texture_numbers(item, number)


def _refuse_constant(constant: str) -> None:
    """Raises an error for NaN and infinities, which are not valid JSON."""
    raise ValueError(f"{constant} is not a number")


def _material_object(material: str) -> dict[str, Any]:
    """Returns the JSON object of a material's text. Raises InputError if the text is not a JSON object."""
    try:
        value = json.loads(material, parse_constant=_refuse_constant)
    except (ValueError, RecursionError):
        value = None
    if not isinstance(value, dict):
        raise InputError("a material is not a JSON object", where="materials", remedy=_EXPORT_ADVICE)
    return value


def barycentric(points: Float, corners: Float) -> Float:
    """Returns (N, 3) barycentric coordinates of points (N, 3) in triangles (N, 3, 3). They are clamped to
    0..1, and their sum is one.
    """
    u, v, w = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    uu, uv, vv = (u * u).sum(1), (u * v).sum(1), (v * v).sum(1)
    wu, wv = (w * u).sum(1), (w * v).sum(1)
    area = uu * vv - uv * uv
    is_regular = area > 1e-14 * np.maximum(uu, vv) ** 2
    scale = np.where(is_regular, area, 1.0)
    b = np.where(is_regular, (vv * wu - uv * wv) / scale, 0.0)
    c = np.where(is_regular, (uu * wv - uv * wu) / scale, 0.0)
    coordinates = np.clip(np.stack([1 - b - c, b, c], 1), 0.0, 1.0)
    return np.asarray(coordinates / coordinates.sum(1, keepdims=True))


def materials_within(
    materials: MeshMaterials | None, old: AnyArray, corners: Float, faces: Int
) -> MeshMaterials | None:
    """Interpolates materials at the corners of new faces that lie within old faces. Returns None if there are
    no materials.

    Args:
        old: (F, 3, 3) corners of the old faces, metres.
        corners: (K, 3, 3) corners of the new faces, metres.
        faces: (K,) the old face that contains each new face, or -1.
    """
    if materials is None:
        return None
    old_corners = np.repeat(old[faces] if len(old) else np.zeros((len(faces), 3, 3)), 3, 0)
    coordinates = barycentric(corners.reshape(-1, 3), old_corners)
    return materials.interpolate_within(faces, coordinates.reshape(-1, 3, 3))
