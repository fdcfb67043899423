"""Simplified materials for formats other than glTF, with factors and images only."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from enliven.meshes import MeshMaterials

_SUFFIXES = {"image/png": ".png", "image/jpeg": ".jpg"}
_MAX_REPEATS = 1e4
"""Maximum number of repeats of an image, and maximum offset and rotation of its coordinates."""
_DEFAULT_CUTOFF = 0.5
"""Default of the opacity below which a masked material is invisible."""


@dataclass(frozen=True)
class TextureUse:
    """A texture of a material.

    Attributes:
        texture: number of the texture in the textures of the mesh.
        uv_set: number of the set of texture coordinates.
        offset, rotation, scale: the transform of the coordinates (KHR_texture_transform). The scale is
            applied first, then the rotation (radians), then the offset.
    """

    texture: int
    uv_set: int = 0
    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)

    @property
    def is_plain(self) -> bool:
        """True if the coordinates are not transformed."""
        return self.offset == (0.0, 0.0) and self.rotation == 0.0 and self.scale == (1.0, 1.0)


@dataclass(frozen=True)
class PlainMaterial:
    """A simplified glTF material. The transforms of texture coordinates are the only supported extension.

    Attributes:
        name: the material's name, or an empty string.
        base: base colour (linear RGB) and opacity, 0 to 1.
        emissive: emitted colour (linear RGB).
        mode: "OPAQUE", "MASK" or "BLEND".
        cutoff: opacity below which a masked material is invisible.
        base_map, finish_map, normal_map, occlusion_map, emissive_map: textures, or None. The finish map
            contains roughness in green and metalness in blue.
    """

    name: str = ""
    base: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    metallic: float = 1.0
    roughness: float = 1.0
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mode: str = "OPAQUE"
    cutoff: float = _DEFAULT_CUTOFF
    double_sided: bool = False
    base_map: TextureUse | None = None
    finish_map: TextureUse | None = None
    normal_map: TextureUse | None = None
    occlusion_map: TextureUse | None = None
    emissive_map: TextureUse | None = None


def make_plain_materials(materials: MeshMaterials) -> list[PlainMaterial]:
    """Returns the simplified materials of a mesh, in the same order. Values of a wrong type are ignored."""
    return [_make_plain_material(json.loads(definition), materials) for definition in materials.definitions]


def image_suffix(media_type: str) -> str:
    """Returns the file suffix of an image's media type."""
    return _SUFFIXES[media_type]


def _make_plain_material(value: dict[str, Any], materials: MeshMaterials) -> PlainMaterial:
    shading = _find_nested_object(value, "pbrMetallicRoughness")
    sets = materials.uvs.shape[2]

    def texture(table: dict[str, Any], name: str) -> TextureUse | None:
        entry = _find_nested_object(table, name)
        transform = _find_nested_object(_find_nested_object(entry, "extensions"), "KHR_texture_transform")
        index, uv_set = entry.get("index"), transform.get("texCoord", entry.get("texCoord", 0))
        if not (type(index) is int and type(uv_set) is int and 0 <= uv_set < sets):
            return None
        x, y = _bound_numbers(transform, "offset", (0.0, 0.0), -_MAX_REPEATS, _MAX_REPEATS)
        scale_u, scale_v = _bound_numbers(transform, "scale", (1.0, 1.0), -_MAX_REPEATS, _MAX_REPEATS)
        (angle,) = _bound_numbers(transform, "rotation", (0.0,), -_MAX_REPEATS, _MAX_REPEATS)
        return TextureUse(index, uv_set, (x, y), angle, (scale_u, scale_v))

    name = value.get("name")
    base = _bound_numbers(shading, "baseColorFactor", (1.0, 1.0, 1.0, 1.0))
    emissive = _bound_numbers(value, "emissiveFactor", (0.0, 0.0, 0.0))
    mode = value.get("alphaMode")
    return PlainMaterial(
        name=name if isinstance(name, str) else "",
        base=(base[0], base[1], base[2], base[3]),
        metallic=_bound_numbers(shading, "metallicFactor", (1.0,))[0],
        roughness=_bound_numbers(shading, "roughnessFactor", (1.0,))[0],
        emissive=(emissive[0], emissive[1], emissive[2]),
        mode=mode if mode in ("MASK", "BLEND") else "OPAQUE",
        cutoff=_bound_numbers(value, "alphaCutoff", (_DEFAULT_CUTOFF,))[0],
        double_sided=value.get("doubleSided") is True,
        base_map=texture(shading, "baseColorTexture"),
        finish_map=texture(shading, "metallicRoughnessTexture"),
        normal_map=texture(value, "normalTexture"),
        occlusion_map=texture(value, "occlusionTexture"),
        emissive_map=texture(value, "emissiveTexture"),
    )


def _find_nested_object(value: dict[str, Any], name: str) -> dict[str, Any]:
    """Returns a nested JSON object, or an empty object if the value has another type."""
    inner = value.get(name)
    return inner if isinstance(inner, dict) else {}


def _bound_numbers(
    value: dict[str, Any], name: str, usual: tuple[float, ...], minimum: float = 0.0, maximum: float = 1.0
) -> tuple[float, ...]:
    """Returns a number or a list of numbers within bounds. The list has the same length as ``usual``."""
    value_in_file = value.get(name)
    values: Any = [value_in_file] if len(usual) == 1 else value_in_file
    if not isinstance(values, list) or len(values) != len(usual):
        return usual
    numbers = [float(number) for number in values if type(number) in (int, float)]
    return (
        tuple(min(max(number, minimum), maximum) for number in numbers)
        if len(numbers) == len(usual)
        else usual
    )
