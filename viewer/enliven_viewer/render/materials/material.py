"""The shader parameters of a glTF material, read from its JSON. Invalid values count as missing."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import Any, Literal

Alpha = Literal["OPAQUE", "MASK", "BLEND"]
Transform = tuple[float, float, float, float, float, float]
"""a, b, c, d, e, f of u' = a u + b v + c and v' = d u + e v + f."""

STRAIGHT: Transform = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
"""The identity transform of texture coordinates."""
MAPS = ("base", "finish", "normal", "occlusion", "emissive")
"""The textures of a material, by their names in the shaders."""
_MAX_EMISSION = 1000.0
"""Maximum emission relative to white. Beyond it, everything is white anyway."""
_MAX_REPEATS = 1e4
"""Maximum number of texture repeats. Beyond it, the image is not recognisable."""


@dataclass(frozen=True)
class Map:
    """A texture of a material.

    Attributes:
        texture: number among the textures of the mesh.
        uvs: number of the set of texture coordinates.
        transform: transform of the coordinates (KHR_texture_transform).
    """

    texture: int
    uvs: int = 0
    transform: Transform = STRAIGHT


@dataclass(frozen=True)
class SurfaceMaterial:
    """The material of a surface.

    Attributes:
        base: linear base colour and opacity.
        metallic, roughness: 0..1.
        emissive: linear emitted light.
        alpha: how opacity is drawn.
        cutoff: minimum opacity that is drawn, for "MASK".
        double_sided: whether back faces are visible.
        unlit: whether it shows its colour without lighting.
        normal_scale: strength of the normal map.
        occlusion_strength: strength of the occlusion map, 0..1.
        maps: its textures by the names in :data:`MAPS`.
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


def material_of(definition: str) -> SurfaceMaterial:
    """Returns the material of a glTF material's JSON object."""
    value = json.loads(definition)
    own = _table(value, "pbrMetallicRoughness")
    extensions = _table(value, "extensions")
    older = _table(extensions, "KHR_materials_pbrSpecularGlossiness")
    if older and not own:
        gloss = _number(older, "glossinessFactor", 1.0, 1.0)
        own = {
            "baseColorFactor": older.get("diffuseFactor"),
            "baseColorTexture": older.get("diffuseTexture"),
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0 - gloss,
        }
    strength = _number(
        _table(extensions, "KHR_materials_emissive_strength"), "emissiveStrength", 1.0, _MAX_EMISSION
    )
    maps = {
        "base": _map(own, "baseColorTexture"),
        "finish": _map(own, "metallicRoughnessTexture"),
        "normal": _map(value, "normalTexture"),
        "occlusion": _map(value, "occlusionTexture"),
        "emissive": _map(value, "emissiveTexture"),
    }
    return SurfaceMaterial(
        base=_numbers(own, "baseColorFactor", (1.0,) * 4, 1.0),
        metallic=_number(own, "metallicFactor", 1.0, 1.0),
        roughness=_number(own, "roughnessFactor", 1.0, 1.0),
        emissive=tuple(strength * c for c in _numbers(value, "emissiveFactor", (0.0,) * 3, _MAX_EMISSION)),
        alpha=value.get("alphaMode") if value.get("alphaMode") in ("MASK", "BLEND") else "OPAQUE",
        cutoff=_number(value, "alphaCutoff", 0.5, 1.0),
        double_sided=value.get("doubleSided") is True,
        unlit="KHR_materials_unlit" in extensions,
        normal_scale=_number(_table(value, "normalTexture"), "scale", 1.0, 8.0),
        occlusion_strength=_number(_table(value, "occlusionTexture"), "strength", 1.0, 1.0),
        maps={name: texture_map for name, texture_map in maps.items() if texture_map is not None},
    )


def _map(value: dict[str, Any], name: str) -> Map | None:
    texture_info = _table(value, name)
    index = texture_info.get("index")
    if not isinstance(index, int) or isinstance(index, bool):
        return None
    moved = _table(_table(texture_info, "extensions"), "KHR_texture_transform")
    uvs = moved.get("texCoord", texture_info.get("texCoord", 0))
    x, y = _numbers(moved, "offset", (0.0, 0.0), _MAX_REPEATS, -_MAX_REPEATS)
    across, down = _numbers(moved, "scale", (1.0, 1.0), _MAX_REPEATS, -_MAX_REPEATS)
    turn = _number(moved, "rotation", 0.0, _MAX_REPEATS, -_MAX_REPEATS)
    c, s = math.cos(turn), math.sin(turn)
    transform = (c * across, s * down, x, -s * across, c * down, y)
    return Map(index, uvs if isinstance(uvs, int) and uvs >= 0 else 0, transform)


def _table(value: dict[str, Any], name: str) -> dict[str, Any]:
    """Returns a nested JSON object; empty if the value is something else."""
    inner = value.get(name)
    return inner if isinstance(inner, dict) else {}


def _number(value: dict[str, Any], name: str, usual: float, most: float, least: float = 0.0) -> float:
    """Returns a number clamped to its bounds; ``usual`` if the value is not a number."""
    given = value.get(name)
    good = isinstance(given, (int, float)) and not isinstance(given, bool)
    return min(max(float(given), least), most) if good else usual


def _numbers(
    value: dict[str, Any], name: str, usual: tuple[float, ...], most: float, least: float = 0.0
) -> tuple[float, ...]:
    """Returns a list of numbers clamped to their bounds, as long as ``usual``.

    Returns ``usual`` if the value is something else.
    """
    numbers = value.get(name)
    if not isinstance(numbers, list) or len(numbers) != len(usual):
        return usual
    return tuple(
        _number({name: number}, name, own, most, least) for number, own in zip(numbers, usual, strict=True)
    )
