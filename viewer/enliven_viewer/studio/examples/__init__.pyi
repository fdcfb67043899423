from .coverage import CoverageCache as CoverageCache, TakeCoverage as TakeCoverage
from .example_edits import (
    HardConstraint as HardConstraint,
    added_switch as added_switch,
    constraints_of as constraints_of,
    duplicated as duplicated,
    layer_of as layer_of,
    mirrored_copy as mirrored_copy,
    moved_switch as moved_switch,
    removed_switch as removed_switch,
    retimed as retimed,
    turned_a_quarter as turned_a_quarter,
    with_constraint as with_constraint,
    with_default_settings as with_default_settings,
    with_guessed_joints as with_guessed_joints,
    with_joint as with_joint,
    with_points as with_points,
    with_setting as with_setting,
    without_constraint as without_constraint,
)
from .motion_solver import MotionSolver as MotionSolver
