from .bake import BakedSurface, bake_surface
from .frames import SurfaceFrames, states_of
from .maps import stretch_axes
from .morphs import BakedMorphs, bake_morphs
from .nodes import EdgeGraph
from .settings import BakeError, BakeSettings

__all__ = [
    "BakeError",
    "BakeSettings",
    "BakedMorphs",
    "BakedSurface",
    "EdgeGraph",
    "SurfaceFrames",
    "bake_morphs",
    "bake_surface",
    "states_of",
    "stretch_axes",
]
