from . import skin_values as skin_values
from .heat_diffusion import (
    HeatSettings as HeatSettings,
    bone_heat as bone_heat,
    cotangents as cotangents,
    heat_weights as heat_weights,
    segments_of as segments_of,
)
from .skin_values import bone_count as bone_count, dense as dense, sparse as sparse
from .skins import (
    InsertSettings as InsertSettings,
    follows as follows,
    nearest_bone as nearest_bone,
    renumbered as renumbered,
    shared_skin as shared_skin,
    upper_part as upper_part,
)
