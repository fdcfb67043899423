"""The shader parameters of a glTF material, read from its JSON. Invalid values count as missing."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import Any, Literal

Alpha = Literal["OPAQUE", "MASK", "BLEND"]
TextureTransform = tuple[float, float, float, float, float, float]
"""The coefficients a, b, c, d, e, f of the texture transform u' = a u + b v + c, v' = d u + e v + f."""

IDENTITY_TRANSFORM: TextureTransform = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
"""The identity transform of texture coordinates."""
MAP_NAMES = ("base", "finish", "normal", "occlusion", "emissive")
"""The textures of a material, by their names in the shaders."""
_MAX_EMISSION = 1000.0
"""Maximum emission relative to white. Stronger emission appears white in any colour."""
_MAX_REPEATS = 1e4
"""Maximum number of texture repeats. With more, the image is not recognisable."""


@dataclass(frozen=True)
class Map:
    """A texture of a material.

    Attributes:
        texture: index of the texture in the mesh.
        uvs: index of the set of texture coordinates.
        transform: transform of the coordinates (KHR_texture_transform).
    """

    texture: int
    uvs: int = 0
    transform: TextureTransform = IDENTITY_TRANSFORM


@dataclass(frozen=True)
class SurfaceMaterial:
    """The material of a surface.

    Attributes:
        base: linear base colour and opacity.
        metallic, roughness: 0..1.
        emissive: linear emitted light.
        alpha: glTF's alphaMode, "OPAQUE", "MASK" or "BLEND".
        cutoff: minimum opacity of drawn pixels in the mode "MASK".
        double_sided: whether back faces are visible.
        unlit: True if it is drawn without lighting.
        normal_scale: strength of the normal map.
        occlusion_strength: strength of the occlusion map, 0..1.
        maps: the textures by the names in :data:`MAP_NAMES`.
    """

    base: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    metallic: float = 0.0
    roughness: float = 0.58
    emissive: tuple[float, ...] = (0.0, 0.0, 0.0)
    alpha: Alpha = "OPAQUE"
    cutoff: float = 0.5
    double_sided: bool = True
    unlit: bool = False
    normal_scale: float = 1.0
    occlusion_strength: float = 1.0
    maps: dict[str, Map] = field(default_factory=dict)


def read_material(definition: str) -> SurfaceMaterial:
    """Returns the material of a glTF material's JSON object."""
    value = json.loads(definition)
    metallic_roughness = _read_table(value, "pbrMetallicRoughness")
    extensions = _read_table(value, "extensions")
    specular_glossiness = _read_table(extensions, "KHR_materials_pbrSpecularGlossiness")
    if specular_glossiness and not metallic_roughness:
        gloss = _read_number(specular_glossiness, "glossinessFactor", 1.0, 1.0)
        metallic_roughness = {
            "baseColorFactor": specular_glossiness.get("diffuseFactor"),
            "baseColorTexture": specular_glossiness.get("diffuseTexture"),
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0 - gloss,
        }
    strength = _read_number(
        _read_table(extensions, "KHR_materials_emissive_strength"), "emissiveStrength", 1.0, _MAX_EMISSION
    )
    maps = {
        "base": _read_map(metallic_roughness, "baseColorTexture"),
        "finish": _read_map(metallic_roughness, "metallicRoughnessTexture"),
        "normal": _read_map(value, "normalTexture"),
        "occlusion": _read_map(value, "occlusionTexture"),
        "emissive": _read_map(value, "emissiveTexture"),
    }
    return SurfaceMaterial(
        base=_read_numbers(metallic_roughness, "baseColorFactor", (1.0,) * 4, 1.0),
        metallic=_read_number(metallic_roughness, "metallicFactor", 1.0, 1.0),
        roughness=_read_number(metallic_roughness, "roughnessFactor", 1.0, 1.0),
        emissive=tuple(
            strength * c for c in _read_numbers(value, "emissiveFactor", (0.0,) * 3, _MAX_EMISSION)
        ),
        alpha=value.get("alphaMode") if value.get("alphaMode") in ("MASK", "BLEND") else "OPAQUE",
        cutoff=_read_number(value, "alphaCutoff", 0.5, 1.0),
        double_sided=value.get("doubleSided") is True,
        unlit="KHR_materials_unlit" in extensions,
        normal_scale=_read_number(_read_table(value, "normalTexture"), "scale", 1.0, 8.0),
        occlusion_strength=_read_number(_read_table(value, "occlusionTexture"), "strength", 1.0, 1.0),
        maps={name: texture_map for name, texture_map in maps.items() if texture_map is not None},
    )


def _read_map(value: dict[str, Any], name: str) -> Map | None:
    texture_info = _read_table(value, name)
    index = texture_info.get("index")
    if not isinstance(index, int) or isinstance(index, bool):
        return None
    texture_transform = _read_table(_read_table(texture_info, "extensions"), "KHR_texture_transform")
    uvs = texture_transform.get("texCoord", texture_info.get("texCoord", 0))
    x, y = _read_numbers(texture_transform, "offset", (0.0, 0.0), _MAX_REPEATS, -_MAX_REPEATS)
    scale_u, scale_v = _read_numbers(texture_transform, "scale", (1.0, 1.0), _MAX_REPEATS, -_MAX_REPEATS)
    angle = _read_number(texture_transform, "rotation", 0.0, _MAX_REPEATS, -_MAX_REPEATS)
    c, s = math.cos(angle), math.sin(angle)
    transform = (c * scale_u, s * scale_v, x, -s * scale_u, c * scale_v, y)
    return Map(index, uvs if isinstance(uvs, int) and uvs >= 0 else 0, transform)


def _read_table(value: dict[str, Any], name: str) -> dict[str, Any]:
    """Returns a nested JSON object, or an empty result if the value is something else."""
    inner = value.get(name)
    return inner if isinstance(inner, dict) else {}


def _read_number(
    value: dict[str, Any], name: str, default: float, maximum: float, minimum: float = 0.0
) -> float:
    """Returns a number clamped to its bounds; ``default`` if the value is not a number."""
    value_in_file = value.get(name)
    is_number = isinstance(value_in_file, (int, float)) and not isinstance(value_in_file, bool)
    return min(max(float(value_in_file), minimum), maximum) if is_number else default


def _read_numbers(
    value: dict[str, Any], name: str, defaults: tuple[float, ...], maximum: float, minimum: float = 0.0
) -> tuple[float, ...]:
    """Returns a list of numbers clamped to their bounds, as long as ``defaults``.

    Returns ``defaults`` if the value is something else.
    """
    numbers = value.get(name)
    if not isinstance(numbers, list) or len(numbers) != len(defaults):
        return defaults
    return tuple(
        _read_number({name: number}, name, default, maximum, minimum)
        for number, default in zip(numbers, defaults, strict=True)
    )
