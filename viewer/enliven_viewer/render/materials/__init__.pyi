from .material import SurfaceMaterial as SurfaceMaterial, read_material as read_material
from .paint import (
    PaintedFaces as PaintedFaces,
    linear_from_srgb as linear_from_srgb,
    paint_keys as paint_keys,
    paint_surface as paint_surface,
)
from .parts import Part as Part, make_parts as make_parts
from .textures import SharedTexture as SharedTexture, Textures as Textures
