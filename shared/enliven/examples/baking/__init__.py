"""Baking: a surface that control points move becomes bones and morph targets that other programs play."""

from enliven.examples.baking.bake import BakedSurface, bake_surface
from enliven.examples.baking.frames import SurfaceFrames, states_of
from enliven.examples.baking.maps import stretch_axes
from enliven.examples.baking.morphs import BakedMorphs, bake_morphs
from enliven.examples.baking.nodes import Net
from enliven.examples.baking.settings import BakeError, BakeSettings

__all__ = [
    "BakeError",
    "BakeSettings",
    "BakedMorphs",
    "BakedSurface",
    "Net",
    "SurfaceFrames",
    "bake_morphs",
    "bake_surface",
    "states_of",
    "stretch_axes",
]
