from .material import SurfaceMaterial as SurfaceMaterial, material_of as material_of
from .paint import (
    PaintedFaces as PaintedFaces,
    linear_from_srgb as linear_from_srgb,
    paint_keys as paint_keys,
    paint_surface as paint_surface,
)
from .parts import Part as Part, parts_of as parts_of
from .textures import SharedTexture as SharedTexture, Textures as Textures
