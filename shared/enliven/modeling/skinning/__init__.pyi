from . import skin_values
from .heat_diffusion import HeatSettings, bone_heat, cotangents, heat_weights, segments_of
from .skin_values import bone_count, dense, sparse
from .skins import InsertSettings, follows, nearest_bone, renumbered, shared_skin, upper_part

__all__ = [
    "HeatSettings",
    "InsertSettings",
    "bone_count",
    "bone_heat",
    "cotangents",
    "dense",
    "follows",
    "heat_weights",
    "nearest_bone",
    "renumbered",
    "segments_of",
    "shared_skin",
    "skin_values",
    "sparse",
    "upper_part",
]
