from .rigid_transform import (
    UP as UP,
    angle_between as angle_between,
    best_rigid as best_rigid,
    cross_matrix as cross_matrix,
    inverse as inverse,
    moved as moved,
    rigid as rigid,
    rotation_vector as rotation_vector,
    turn as turn,
    turned as turned,
)
from .space import (
    Place as Place,
    Space as Space,
    load_space as load_space,
    rows as rows,
    save_space as save_space,
)
