"""Materials of a USD stage: UsdPreviewSurface with textures, converted from glTF materials."""

from __future__ import annotations

import json
import math
from typing import Any, NamedTuple

from pxr import Gf, Sdf, Usd, UsdShade

from enliven.document import unused
from enliven.exporters.plain_materials import PlainMaterial, TextureUse, image_suffix, make_plain_materials
from enliven.meshes import MeshMaterials

_PLAIN_ROUGHNESS = 0.9
"""Roughness of the default material, for faces without a material. It is high, so that these faces do not
look shiny."""
_WRAPS = {33071: "clamp", 33648: "mirror", 10497: "repeat"}
"""USD wrap modes by the wrap mode of glTF samplers."""


class BoundMaterial(NamedTuple):
    """A material of the USD stage, with a flag that is True if both sides of its faces are visible."""

    material: UsdShade.Material
    double_sided: bool


class StageMaterials:
    """The materials of all meshes of a stage. Equal materials are stored once.

    Args:
        stage: the stage under construction.
        path: path of the parent prim of the materials.
        folder: name of the folder of images.

    Attributes:
        images: the bytes of the image files by file name.
    """

    def __init__(self, stage: Usd.Stage, path: Sdf.Path, folder: str) -> None:
        self.images: dict[str, bytes] = {}
        self.folder = folder
        self._stage, self._path = stage, path
        self._names = set[str]()
        self._plain: UsdShade.Material | None = None
        self._bound: dict[tuple[Any, ...], BoundMaterial] = {}

    def get_plain_material(self) -> UsdShade.Material:
        """Returns a material that shows the vertex colours."""
        if self._plain is None:
            material, surface = self._define("plain")
            surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(_PLAIN_ROUGHNESS)
            surface.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
            colour = self._add_shader(material, "colour", "UsdPrimvarReader_float3")
            colour.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
            colour.CreateInput("fallback", Sdf.ValueTypeNames.Float3).Set(Gf.Vec3f(1.0))
            output = colour.CreateOutput("result", Sdf.ValueTypeNames.Float3)
            surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(output)
            self._plain = material
        return self._plain

    def add(self, materials: MeshMaterials) -> list[BoundMaterial]:
        """Adds the materials of a mesh with their images. Returns the USD materials in the same order."""
        images = [self._image_name(texture.image.tobytes(), texture.kind) for texture in materials.textures]
        samplers = tuple(zip(images, (texture.sampler for texture in materials.textures), strict=True))
        bound_materials = list[BoundMaterial]()
        for definition, plain_material in zip(
            materials.definitions, make_plain_materials(materials), strict=True
        ):
            key = (definition, samplers)
            if key not in self._bound:
                self._bound[key] = self._add_material(plain_material, materials, images)
            bound_materials.append(self._bound[key])
        return bound_materials

    def _add_material(
        self, plain: PlainMaterial, materials: MeshMaterials, images: list[str]
    ) -> BoundMaterial:
        """Adds one material."""
        material, surface = self._define(plain.name)

        def texture(name: str, use: TextureUse, is_colour: bool) -> UsdShade.Shader:
            sampler = materials.textures[use.texture].sampler
            return self._add_texture(material, name, images[use.texture], sampler, use, is_colour)

        self._add_base(plain, surface, texture)
        rough = surface.CreateInput("roughness", Sdf.ValueTypeNames.Float)
        metal = surface.CreateInput("metallic", Sdf.ValueTypeNames.Float)
        rough.Set(plain.roughness)
        metal.Set(plain.metallic)
        if plain.finish_map is not None:
            finish = texture("finish", plain.finish_map, False)
            finish.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(
                Gf.Vec4f(1.0, plain.roughness, plain.metallic, 1.0)
            )
            rough.ConnectToSource(finish.CreateOutput("g", Sdf.ValueTypeNames.Float))
            metal.ConnectToSource(finish.CreateOutput("b", Sdf.ValueTypeNames.Float))
        if plain.normal_map is not None:
            bumps = texture("normal", plain.normal_map, False)
            bumps.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(2.0, 2.0, 2.0, 1.0))
            bumps.CreateInput("bias", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(-1.0, -1.0, -1.0, 0.0))
            output = bumps.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
            surface.CreateInput("normal", Sdf.ValueTypeNames.Normal3f).ConnectToSource(output)
        if plain.occlusion_map is not None:
            shade = texture("occlusion", plain.occlusion_map, False)
            output = shade.CreateOutput("r", Sdf.ValueTypeNames.Float)
            surface.CreateInput("occlusion", Sdf.ValueTypeNames.Float).ConnectToSource(output)
        emission = surface.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f)
        emission.Set(Gf.Vec3f(*plain.emissive))
        if plain.emissive_map is not None:
            glow = texture("emissive", plain.emissive_map, True)
            glow.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(*plain.emissive, 1.0))
            emission.ConnectToSource(glow.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))
        return BoundMaterial(material, plain.double_sided)

    def _add_base(self, plain: PlainMaterial, surface: UsdShade.Shader, texture: Any) -> None:
        """Adds base colour and opacity."""
        colour = surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
        colour.Set(Gf.Vec3f(*plain.base[:3]))
        opaque = plain.mode == "OPAQUE"
        opacity = surface.CreateInput("opacity", Sdf.ValueTypeNames.Float)
        opacity.Set(1.0 if opaque else plain.base[3])
        if plain.mode == "MASK":
            surface.CreateInput("opacityThreshold", Sdf.ValueTypeNames.Float).Set(plain.cutoff)
        if plain.base_map is not None:
            base = texture("base", plain.base_map, True)
            base.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(*plain.base))
            colour.ConnectToSource(base.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))
            if not opaque:
                opacity.ConnectToSource(base.CreateOutput("a", Sdf.ValueTypeNames.Float))

    def _define(self, name: str) -> tuple[UsdShade.Material, UsdShade.Shader]:
        """Adds a material with a surface shader."""
        prim_name = unused(_shader_name(name), self._names, "_")
        self._names.add(prim_name)
        if not self._stage.GetPrimAtPath(self._path):
            self._stage.DefinePrim(self._path, "Scope")
        material = UsdShade.Material.Define(self._stage, self._path.AppendChild(prim_name))
        surface = self._add_shader(material, "surface", "UsdPreviewSurface")
        output = surface.CreateOutput("surface", Sdf.ValueTypeNames.Token)
        material.CreateSurfaceOutput().ConnectToSource(output)
        return material, surface

    def _add_shader(self, material: UsdShade.Material, name: str, kind: str) -> UsdShade.Shader:
        shader = UsdShade.Shader.Define(self._stage, material.GetPath().AppendChild(name))
        shader.CreateIdAttr(kind)
        return shader

    def _add_texture(
        self,
        material: UsdShade.Material,
        name: str,
        image: str,
        sampler: str,
        use: TextureUse,
        is_colour: bool,
    ) -> UsdShade.Shader:
        """Adds a texture with its coordinates. Returns its shader.

        Args:
            is_colour: True if the image contains sRGB colours, False if it contains other values.
        """
        coordinates = self._add_shader(material, f"{name}_coordinates", "UsdPrimvarReader_float2")
        set_name = f"st{use.uv_set}" if use.uv_set else "st"
        coordinates.CreateInput("varname", Sdf.ValueTypeNames.String).Set(set_name)
        output = coordinates.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        if not use.is_plain:
            moved = self._add_shader(material, f"{name}_transform", "UsdTransform2d")
            moved.CreateInput("in", Sdf.ValueTypeNames.Float2).ConnectToSource(output)
            # In glTF, rows of an image are counted from its top. In USD, they are counted from its bottom.
            cos, sin, scale_v = math.cos(use.rotation), math.sin(use.rotation), use.scale[1]
            shift = Gf.Vec2f(use.offset[0] + sin * scale_v, 1.0 - use.offset[1] - cos * scale_v)
            moved.CreateInput("rotation", Sdf.ValueTypeNames.Float).Set(math.degrees(use.rotation))
            moved.CreateInput("scale", Sdf.ValueTypeNames.Float2).Set(Gf.Vec2f(*use.scale))
            moved.CreateInput("translation", Sdf.ValueTypeNames.Float2).Set(shift)
            output = moved.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        shader = self._add_shader(material, name, "UsdUVTexture")
        shader.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(f"./{self.folder}/{image}"))
        shader.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(output)
        space = "sRGB" if is_colour else "raw"
        shader.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set(space)
        wraps: dict[str, Any] = json.loads(sampler) if sampler else {}
        for axis in ("wrapS", "wrapT"):
            mode = wraps.get(axis)
            wrap = _WRAPS.get(mode, "repeat") if isinstance(mode, int) else "repeat"
            shader.CreateInput(axis, Sdf.ValueTypeNames.Token).Set(wrap)
        return shader

    def _image_name(self, data: bytes, kind: str) -> str:
        for name, image in self.images.items():
            if image == data:
                return name
        name = f"texture_{len(self.images) + 1}{image_suffix(kind)}"
        self.images[name] = data
        return name


def _shader_name(name: str) -> str:
    """Returns a valid prim name for a material."""
    letters = "".join(letter if letter.isalnum() and letter.isascii() else "_" for letter in name)
    return f"material_{letters}" if not letters or letters[0].isdigit() else letters
