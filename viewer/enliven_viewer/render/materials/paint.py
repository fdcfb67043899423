"""A character's colours and materials as vertex attributes, and its faces in drawing order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float32, Int, Int32
from enliven.document import Character
from enliven.meshes import MeshMaterials
from enliven_viewer.render.materials.material import SurfaceMaterial, read_material
from enliven_viewer.render.materials.parts import PLAIN_PART, Part, make_parts
from enliven_viewer.render.surface import DrawnSurface

DEFAULT_COLOUR = (226, 142, 84)
"""sRGB of a mesh without colours: warm, in contrast to the cold colours of the stage."""
_DEFAULT_MATERIAL = SurfaceMaterial()
"""The material of faces without a material: diffuse, like skin, wood or matt paint."""


@dataclass(frozen=True)
class PaintedFaces:
    """The faces of a surface in drawing order, with their colours.

    Attributes:
        order: (F,) the faces in drawing order.
        parts: each batch with its first face and its number of faces in ``order``.
        rows: (N, 13) float32 per drawn vertex: two sets of texture coordinates; linear colour and opacity;
            metallic and roughness; emitted light.
    """

    order: Int
    parts: tuple[tuple[Part, int, int], ...]
    rows: Float32


def paint_keys(character: Character) -> Int32 | None:
    """Returns (3 F, K) keys of the face corners. Corners of one vertex with different keys need separate
    drawn vertices. Returns None if all corners have the same key.
    """
    mesh_materials = character.materials
    if mesh_materials is None:
        return None
    faces = np.asarray(character.faces, np.int32)
    columns = [faces.reshape(-1, 1), np.repeat(mesh_materials.of, 3)[:, None]]
    columns.append(mesh_materials.uvs.reshape(faces.size, -1).view(np.int32))
    if mesh_materials.tints is not None:
        columns.append(mesh_materials.tints.reshape(faces.size, -1).view(np.int32))
    return np.ascontiguousarray(np.concatenate(columns, 1))


def paint_surface(character: Character, surface: DrawnSurface) -> PaintedFaces:
    """Returns the vertex attributes of a character's colours, and the batches of its faces."""
    mesh_materials = character.materials
    rows = np.zeros((len(surface.source), 13), np.float32)
    rows[:, 4:7] = _find_linear_colours(character)[surface.source]
    rows[:, 7:10] = 1.0, _DEFAULT_MATERIAL.metallic, _DEFAULT_MATERIAL.roughness
    if mesh_materials is None:
        return PaintedFaces(np.arange(len(surface.faces)), ((PLAIN_PART, 0, len(surface.faces)),), rows)
    # The last material has the index -1, which means no material.
    materials = [*map(read_material, mesh_materials.definitions), _DEFAULT_MATERIAL]
    parts = [*make_parts(materials[:-1], mesh_materials.textures, mesh_materials.uvs.shape[2]), PLAIN_PART]
    _paint(rows, mesh_materials, materials, parts, surface)
    kinds = sorted(set(parts), key=lambda part: part.rank)
    number = np.array([kinds.index(part) for part in parts])[mesh_materials.of]
    counts = np.bincount(number, minlength=len(kinds))
    starts = np.concatenate([[0], np.cumsum(counts)])
    parts_in_order = (
        (part, int(start), int(count)) for part, start, count in zip(kinds, starts, counts, strict=False)
    )
    return PaintedFaces(
        np.argsort(number, kind="stable"), tuple(batch for batch in parts_in_order if batch[2]), rows
    )


def _paint(
    rows: Float32,
    mesh_materials: MeshMaterials,
    materials: list[SurfaceMaterial],
    parts: list[Part],
    surface: DrawnSurface,
) -> None:
    """Fills the rows of the corners that have a material."""
    face, corner = np.divmod(surface.corner, 3)
    material_of_face = mesh_materials.of[face]
    for k, (material, part) in enumerate(zip(materials[:-1], parts, strict=False)):
        rows_of_material = np.flatnonzero(material_of_face == k)
        rows[rows_of_material, 4:8] = np.array(material.base, np.float32)
        rows[rows_of_material, 8:10] = material.metallic, material.roughness
        rows[rows_of_material, 10:13] = material.emissive
        for slot, (number, (a, b, c, d, e, f)) in enumerate(part.texture_mappings):
            u, v = mesh_materials.uvs[face[rows_of_material], corner[rows_of_material], number].T
            rows[rows_of_material, 2 * slot], rows[rows_of_material, 2 * slot + 1] = (
                a * u + b * v + c,
                d * u + e * v + f,
            )
    if mesh_materials.tints is not None:
        material_corners = np.flatnonzero(material_of_face >= 0)
        rows[material_corners, 4:8] *= mesh_materials.tints[face[material_corners], corner[material_corners]]


def _find_linear_colours(character: Character) -> Float32:
    """Returns (V, 3) float32 linear RGB of the character's colours."""
    colours = character.colours
    if colours is None:
        colours = np.tile(np.array(DEFAULT_COLOUR, np.uint8), (len(character.vertices), 1))
    return linear_from_srgb(colours)


def linear_from_srgb(srgb: np.ndarray) -> Float32:
    """Converts sRGB values 0..255 to linear RGB, float32 (IEC 61966-2-1)."""
    encoded = np.asarray(srgb, np.float64) / 255
    linear = np.where(
        encoded <= 0.04045, encoded / 12.92, ((np.maximum(encoded, 0.0) + 0.055) / 1.055) ** 2.4
    )
    return np.asarray(linear, dtype=np.float32)
