"""Layers of motion on a skeleton: turns along arc length, sampled, multiplied and placed (AniMesh, section
5).
"""

from enliven.motion.layers.copying import copy_motion
from enliven.motion.layers.evaluate import Player, pose_from, pose_of
from enliven.motion.layers.polyline import arc_of, goes_down
from enliven.motion.layers.retarget import (
    bind_chain,
    branch,
    clear_chain,
    layers_of,
    set_travel,
    without_idle_layers,
)
from enliven.motion.layers.travel import travel_scale

__all__ = [
    "Player",
    "arc_of",
    "bind_chain",
    "branch",
    "clear_chain",
    "copy_motion",
    "goes_down",
    "layers_of",
    "pose_from",
    "pose_of",
    "set_travel",
    "travel_scale",
    "without_idle_layers",
]
