from .rigid_transform import (
    UP as UP,
    angle_between as angle_between,
    fit_rigid as fit_rigid,
    cross_matrix as cross_matrix,
    invert as invert,
    transform_points as transform_points,
    compose_transform as compose_transform,
    rotation_vector as rotation_vector,
    rotation_from_vector as rotation_from_vector,
    rotate_vectors as rotate_vectors,
)
from .space import (
    Place as Place,
    Space as Space,
    load_space as load_space,
    nested_tuples as nested_tuples,
    save_space as save_space,
)
