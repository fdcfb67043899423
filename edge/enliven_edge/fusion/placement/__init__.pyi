from .rigid_transform import (
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
from .space import Place, Space, load_space, rows, save_space

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
