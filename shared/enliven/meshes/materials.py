"""The materials of a mesh and their encoded textures, as glTF 2.0 has them, and its corners in the textures.

Nothing is decoded: images stay the bytes that the file had, and a material stays its JSON. Texture
coordinates belong to the corners of faces, so vertices may be joined without harm.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from enliven.arrays import AnyArray, Bool, Float, Float32, Int, Int32, UInt8
from enliven.errors import InputError

_AGAIN = "Export the model again."
"""What to do about a damaged material."""


@dataclass(frozen=True, eq=False)
class Texture:
    """An encoded image and how it is sampled.

    Attributes:
        image: (N,) the bytes of a PNG or JPEG file.
        sampler: the JSON of a glTF sampler; empty for none.
    """

    image: UInt8
    sampler: str = ""

    def __post_init__(self) -> None:
        if not self.kind:
            raise InputError("a texture is neither PNG nor JPEG", where="materials", mend=_AGAIN)
        if self.sampler:
            _object(self.sampler)

    @property
    def kind(self) -> str:
        """The image's media type by its first bytes; empty for another than glTF allows."""
        head = np.asarray(self.image, np.uint8)[:8].tobytes()
        return "image/png" if head == b"\x89PNG\r\n\x1a\n" else "image/jpeg" * (head[:3] == b"\xff\xd8\xff")


@dataclass(frozen=True, eq=False)
class MeshMaterials:
    """The materials of a mesh by face, and its corners in their textures.

    Attributes:
        definitions: JSON objects of glTF materials; they name textures by their number in ``textures``.
        textures: what the materials name.
        of: (F,) int32 the material of each face; -1 for none, where vertex colours are all there is.
        uvs: (F, 3, S, 2) float32, where each corner is in S sets of texture coordinates.
        tints: (F, 3, 4) float32 linear colour and opacity that multiply the material's, or None for white.

    Raises:
        InputError: where the parts do not fit together.
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
            named = textures_in(_object(material))
            if named and not 0 <= min(named) <= max(named) < len(self.textures):
                problem = f"a material names texture {max(named)} of {len(self.textures)}"
        if self.uvs.ndim != 4 or self.uvs.shape[:2] != (faces, 3) or self.uvs.shape[3] != 2:
            problem = f"the texture coordinates are {self.uvs.shape}, expected ({faces}, 3, S, 2)"
        elif self.tints is not None and self.tints.shape != (faces, 3, 4):
            problem = f"the tints are {self.tints.shape}, expected ({faces}, 3, 4)"
        elif faces and not -1 <= self.of.min() <= self.of.max() < len(self.definitions):
            problem = f"a face has a material outside of {len(self.definitions)}"
        elif not (np.isfinite(self.uvs).all() and (self.tints is None or np.isfinite(self.tints).all())):
            problem = "a corner's place in a texture, or its tint, is not finite"
        if problem:
            raise InputError(problem, where="materials", mend=_AGAIN)

    def taken(self, faces: Int | Bool) -> MeshMaterials:
        """The materials of some faces, by number or by mask."""
        tints = None if self.tints is None else self.tints[faces]
        return replace(self, of=self.of[faces], uvs=self.uvs[faces], tints=tints)

    def turned(self, which: Bool) -> MeshMaterials:
        """Returns the materials of the same faces with the corners of those in ``which`` (F,) in the other
        order."""
        uvs = np.where(which[:, None, None, None], self.uvs[:, ::-1], self.uvs)
        tints = self.tints
        if tints is not None:
            tints = np.where(which[:, None, None], tints[:, ::-1], tints)
        return replace(self, uvs=uvs, tints=tints)

    def within(self, faces: Int, shares: Float) -> MeshMaterials:
        """The materials of new faces (K,) that lie in old ones.

        Args:
            faces: (K,) the old face that each lies in; -1 for one that lies in none, and gets no material.
            shares: (K, 3, 3) each new corner as shares of the old corners.
        """
        if not len(self.of):
            none = joined_materials([(self, 0), (None, len(faces))])
            assert none is not None
            return none
        inside = faces >= 0

        def spread(old: Float32) -> Float32:
            made = np.einsum("kab,kb...->ka...", shares, old[faces].astype(np.float64))
            return np.asarray(np.where(inside.reshape(-1, *[1] * (old.ndim - 1)), made, 0.0), np.float32)

        tints = None if self.tints is None else spread(self.tints)
        of = np.where(inside, self.of[faces], -1).astype(np.int32)
        return replace(self, of=of, uvs=spread(self.uvs), tints=tints)


def joined_materials(groups: Sequence[tuple[MeshMaterials | None, int]]) -> MeshMaterials | None:
    """One value for several groups of faces in a row, each given with its number of faces.

    Equal materials and textures become one; None where no group has any.
    """
    if all(own is None for own, _ in groups):
        return None
    textures: dict[tuple[bytes, str], tuple[int, Texture]] = {}
    materials: dict[str, int] = {}
    sets = max(own.uvs.shape[2] for own, _ in groups if own is not None)
    tinted = any(own is not None and own.tints is not None for own, _ in groups)
    of, uvs, tints = list[Int32](), list[Float32](), list[Float32]()
    for own, count in groups:
        at: Int32 = np.full(count, -1, np.int32)
        place = np.zeros((count, 3, sets, 2), np.float32)
        tint = np.ones((count, 3, 4), np.float32)
        if own is not None:
            texture_of = [
                textures.setdefault((t.image.tobytes(), t.sampler), (len(textures), t))[0]
                for t in own.textures
            ]
            told = [renumbered(material, texture_of.__getitem__) for material in own.definitions]
            number = np.array([*(materials.setdefault(text, len(materials)) for text in told), -1], np.int32)
            at, place[:, :, : own.uvs.shape[2]] = number[own.of], own.uvs
            tint = tint if own.tints is None else own.tints
        of.append(at)
        uvs.append(place)
        tints.append(tint)
    kept = tuple(texture for _, texture in textures.values())
    all_tints = np.concatenate(tints) if tinted else None
    return MeshMaterials(tuple(materials), kept, np.concatenate(of), np.concatenate(uvs), all_tints)


def textures_in(material: Any) -> list[int]:
    """The numbers of all textures that a material names, also in extensions."""
    found = list[int]()
    _walk(material, lambda number: found.append(number) or number)
    return found


def renumbered(material: str, number: Callable[[int], int]) -> str:
    """The JSON of a material with each texture's number changed."""
    value = _object(material)
    _walk(value, number)
    return json.dumps(value, sort_keys=True, allow_nan=False)


def _walk(value: Any, number: Callable[[int], int]) -> None:
    """Replaces the number of every texture that a JSON value names by what ``number`` makes of it."""
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
        if isinstance(key, str) and key.endswith("Texture") and isinstance(inner, dict):
            at = inner.get("index")
            if not isinstance(at, int) or isinstance(at, bool):
                raise InputError(f"a material's {key} names no texture", where="materials")
            inner["index"] = number(at)
        if isinstance(inner, (dict, list)):
            _walk(inner, number)


def _refused(constant: str) -> None:
    """Refuses NaN and infinities, which JSON has not."""
    raise ValueError(f"{constant} is no number")


def _object(material: str) -> dict[str, Any]:
    """The object of a material's JSON."""
    try:
        value = json.loads(material, parse_constant=_refused)
    except (ValueError, RecursionError):
        value = None
    if not isinstance(value, dict):
        raise InputError("a material is no JSON object", where="materials", mend=_AGAIN)
    return value


def barycentric(points: Float, corners: Float) -> Float:
    """(N, 3) shares of the corners (N, 3, 3) at points (N, 3) of their triangles, within 0..1, sum one."""
    u, v, w = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    uu, uv, vv = (u * u).sum(1), (u * v).sum(1), (v * v).sum(1)
    wu, wv = (w * u).sum(1), (w * v).sum(1)
    area = uu * vv - uv * uv
    good = area > 1e-14 * np.maximum(uu, vv) ** 2
    scale = np.where(good, area, 1.0)
    b = np.where(good, (vv * wu - uv * wv) / scale, 0.0)
    c = np.where(good, (uu * wv - uv * wu) / scale, 0.0)
    share = np.clip(np.stack([1 - b - c, b, c], 1), 0.0, 1.0)
    return np.asarray(share / share.sum(1, keepdims=True))


def materials_within(
    own: MeshMaterials | None, old: AnyArray, corners: Float, faces: Int
) -> MeshMaterials | None:
    """The materials of new faces by where their corners lie in old faces; None stays None.

    Args:
        old: (F, 3, 3) metres, the corners of the old faces.
        corners: (K, 3, 3) metres, those of the new ones.
        faces: (K,) the old face that each lies in, or -1.
    """
    if own is None:
        return None
    around = np.repeat(old[faces] if len(old) else np.zeros((len(faces), 3, 3)), 3, 0)
    shares = barycentric(corners.reshape(-1, 3), around)
    return own.within(faces, shares.reshape(-1, 3, 3))
