"""Batches of faces for one draw call. Materials that differ only in numbers share a batch, because the
numbers are stored in the vertices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from enliven.meshes import Texture
from enliven_viewer.render.materials.material import MAP_NAMES, Alpha, SurfaceMaterial, TextureTransform
from enliven_viewer.render.materials.textures import find_mirrored_axes

TextureMapping = tuple[int, TextureTransform]
"""A set of texture coordinates, and its transform."""

_ALPHA_ORDER: tuple[Alpha, ...] = ("OPAQUE", "MASK", "BLEND")


@dataclass(frozen=True)
class Part:
    """The draw state of a batch of faces. Materials that differ only in numbers share a batch.

    Attributes:
        maps: map name and index of each texture, and the index of its texture mapping (0 or 1).
        texture_mappings: at most two sets of texture coordinates with their transforms.
        glows: True if any material in the batch emits light.
    """

    alpha: Alpha = "OPAQUE"
    double_sided: bool = True
    unlit: bool = False
    maps: tuple[tuple[str, int, int], ...] = ()
    texture_mappings: tuple[TextureMapping, ...] = ()
    cutoff: float = 0.5
    normal_scale: float = 1.0
    occlusion_strength: float = 1.0
    glows: bool = False

    @property
    def rank(self) -> int:
        """Returns the batch's rank in the drawing order: opaque batches first, transparent batches last."""
        return _ALPHA_ORDER.index(self.alpha)

    @property
    def defines(self) -> tuple[str, ...]:
        """Returns the preprocessor defines of the batch's shaders."""
        places = ("uv.xy", "uv.zw")
        map_defines = tuple(f"{name.upper()}_MAP {places[map_slot]}" for name, _, map_slot in self.maps)
        flags = ("UNLIT",) * self.unlit + ("EMISSIVE",) * self.glows
        return map_defines + flags + (self.alpha,) * (self.alpha != "OPAQUE")

    @property
    def shadow_defines(self) -> tuple[str, ...]:
        """Returns the preprocessor defines of the batch's shadow shader, which only needs the opacity."""
        return (*(define for define in self.defines if define.startswith("BASE_MAP")), self.alpha)


def make_parts(materials: list[SurfaceMaterial], textures: Sequence[Texture], sets: int) -> list[Part]:
    """Returns the batch of each material. A texture with a third texture mapping uses the first mapping. A
    texture without coordinates is omitted.

    Args:
        textures: the textures that the materials refer to.
        sets: number of sets of texture coordinates.
    """
    folds = [find_mirrored_axes(texture) for texture in textures]
    return [_make_part(material, folds, sets) for material in materials]


def _make_part(material: SurfaceMaterial, folds: list[tuple[bool, bool]], sets: int) -> Part:
    maps, placings = list[tuple[str, int, int]](), list[TextureMapping]()
    for name in MAP_NAMES:
        texture_map = material.maps.get(name)
        if texture_map is None or not sets:
            continue
        scale_u, scale_v = (0.5 if fold else 1.0 for fold in folds[texture_map.texture])
        a, b, c, d, e, f = texture_map.transform
        scaled_transform = scale_u * a, scale_u * b, scale_u * c, scale_v * d, scale_v * e, scale_v * f
        placing = min(texture_map.uvs, sets - 1), scaled_transform
        if placing not in placings and len(placings) < 2:
            placings.append(placing)
        maps.append((name, texture_map.texture, placings.index(placing) if placing in placings else 0))
    map_names = {name for name, *_ in maps}
    return Part(
        alpha=material.alpha,
        double_sided=material.double_sided,
        unlit=material.unlit,
        maps=tuple(maps),
        texture_mappings=tuple(placings),
        cutoff=material.cutoff if material.alpha == "MASK" else 0.5,
        normal_scale=material.normal_scale if "normal" in map_names else 1.0,
        occlusion_strength=material.occlusion_strength if "occlusion" in map_names else 1.0,
        glows=any(material.emissive),
    )


PLAIN_PART = Part()
"""The batch of faces without a material."""
