"""A character's colours and materials as vertex attributes, and its faces in drawing order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float32, Int, Int32
from enliven.document import Character
from enliven.meshes import MeshMaterials
from enliven_viewer.render.materials.material import SurfaceMaterial, material_of
from enliven_viewer.render.materials.parts import PLAIN_PART, Part, parts_of
from enliven_viewer.render.surface import DrawnSurface

DEFAULT_COLOUR = (226, 142, 84)
"""sRGB of a mesh without colours: warm, in contrast to the cold stage."""
_DEFAULT_MATERIAL = SurfaceMaterial()
"""The material of a surface without one: like skin, wood or matt paint."""


@dataclass(frozen=True)
class PaintedFaces:
    """A surface with its colours.

    Attributes:
        order: (F,) the faces in drawing order.
        parts: each part with its first face and number of faces in that order.
        rows: (N, 13) float32 per drawn vertex: two sets of texture coordinates; linear colour and opacity;
            metallic and roughness; emitted light.
    """

    order: Int
    parts: tuple[tuple[Part, int, int], ...]
    rows: Float32


def paint_keys(character: Character) -> Int32 | None:
    """Returns (3 F, K) keys: two corners of a vertex with different keys need separate drawn vertices.

    None if all corners are alike.
    """
    own = character.materials
    if own is None:
        return None
    faces = np.asarray(character.faces, np.int32)
    columns = [faces.reshape(-1, 1), np.repeat(own.of, 3)[:, None]]
    columns.append(own.uvs.reshape(faces.size, -1).view(np.int32))
    if own.tints is not None:
        columns.append(own.tints.reshape(faces.size, -1).view(np.int32))
    return np.ascontiguousarray(np.concatenate(columns, 1))


def paint_surface(character: Character, surface: DrawnSurface) -> PaintedFaces:
    """Returns the vertex attributes of a character's colours, and the batches of its faces."""
    own = character.materials
    rows = np.zeros((len(surface.source), 13), np.float32)
    rows[:, 4:7] = _linear_colours(character)[surface.source]
    rows[:, 7:10] = 1.0, _DEFAULT_MATERIAL.metallic, _DEFAULT_MATERIAL.roughness
    if own is None:
        return PaintedFaces(np.arange(len(surface.faces)), ((PLAIN_PART, 0, len(surface.faces)),), rows)
    # The last material has the index -1, which means no material.
    materials = [*map(material_of, own.definitions), _DEFAULT_MATERIAL]
    parts = [*parts_of(materials[:-1], own.textures, own.uvs.shape[2]), PLAIN_PART]
    _paint(rows, own, materials, parts, surface)
    kinds = sorted(set(parts), key=lambda part: part.rank)
    number = np.array([kinds.index(part) for part in parts])[own.of]
    counts = np.bincount(number, minlength=len(kinds))
    starts = np.concatenate([[0], np.cumsum(counts)])
    drawn = (
        (part, int(start), int(count)) for part, start, count in zip(kinds, starts, counts, strict=False)
    )
    return PaintedFaces(np.argsort(number, kind="stable"), tuple(batch for batch in drawn if batch[2]), rows)


def _paint(
    rows: Float32,
    own: MeshMaterials,
    materials: list[SurfaceMaterial],
    parts: list[Part],
    surface: DrawnSurface,
) -> None:
    """Fills the rows of the corners that have a material."""
    face, corner = np.divmod(surface.corner, 3)
    of = own.of[face]
    for k, (material, part) in enumerate(zip(materials[:-1], parts, strict=False)):
        mine = np.flatnonzero(of == k)
        rows[mine, 4:8] = np.array(material.base, np.float32)
        rows[mine, 8:10] = material.metallic, material.roughness
        rows[mine, 10:13] = material.emissive
        for at, (number, (a, b, c, d, e, f)) in enumerate(part.placings):
            u, v = own.uvs[face[mine], corner[mine], number].T
            rows[mine, 2 * at], rows[mine, 2 * at + 1] = a * u + b * v + c, d * u + e * v + f
    if own.tints is not None:
        some = np.flatnonzero(of >= 0)
        rows[some, 4:8] *= own.tints[face[some], corner[some]]


def _linear_colours(character: Character) -> Float32:
    """Returns (V, 3) float32 linear RGB of the character's colours."""
    colours = character.colours
    if colours is None:
        colours = np.tile(np.array(DEFAULT_COLOUR, np.uint8), (len(character.vertices), 1))
    return linear_from_srgb(colours)


def linear_from_srgb(srgb: np.ndarray) -> Float32:
    """Returns linear RGB, float32, of sRGB values 0..255 (IEC 61966-2-1)."""
    coded = np.asarray(srgb, np.float64) / 255
    linear = np.where(coded <= 0.04045, coded / 12.92, ((np.maximum(coded, 0.0) + 0.055) / 1.055) ** 2.4)
    return np.asarray(linear, dtype=np.float32)
