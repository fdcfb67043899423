"""Skin weights: by heat diffusion from the bones (Pinocchio, 2007), and mended after an edit."""

from enliven.modeling.skinning import skin_values
from enliven.modeling.skinning.heat_diffusion import (
    HeatSettings,
    bone_heat,
    cotangents,
    heat_weights,
    segments_of,
)
from enliven.modeling.skinning.skin_values import bone_count, dense, sparse
from enliven.modeling.skinning.skins import (
    InsertSettings,
    follows,
    nearest_bone,
    renumbered,
    shared_skin,
    upper_part,
)

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
