from .coverage import CoverageCache as CoverageCache, TakeCoverage as TakeCoverage
from .example_edits import (
    HardConstraint as HardConstraint,
    add_switch as add_switch,
    list_constraints as list_constraints,
    duplicate_pose as duplicate_pose,
    find_layer_number as find_layer_number,
    mirror_pose as mirror_pose,
    move_switch as move_switch,
    remove_switch as remove_switch,
    retime_pose as retime_pose,
    turn_quarter as turn_quarter,
    with_constraint as with_constraint,
    with_default_settings as with_default_settings,
    with_guessed_joints as with_guessed_joints,
    with_joint as with_joint,
    with_points as with_points,
    with_setting as with_setting,
    without_constraint as without_constraint,
)
from .motion_solver import MotionSolver as MotionSolver
