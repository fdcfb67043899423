"""Where the sensors of a space stand: rigid transforms, and the TOML file that keeps them."""

from enliven_edge.fusion.placement.rigid_transform import (
    UP,
    angle_between,
    best_rigid,
    cross_matrix,
    inverse,
    moved,
    rigid,
    rotation_vector,
    turn,
    turned,
)
from enliven_edge.fusion.placement.space import Place, Space, load_space, rows, save_space

__all__ = [
    "UP",
    "Place",
    "Space",
    "angle_between",
    "best_rigid",
    "cross_matrix",
    "inverse",
    "load_space",
    "moved",
    "rigid",
    "rotation_vector",
    "rows",
    "save_space",
    "turn",
    "turned",
]
