from .loop_detection import LoopClosure as LoopClosure, correct_trajectory as correct_trajectory
from .history import FrameHistory as FrameHistory
from .pose_graph import (
    PoseLink as PoseLink,
    pose_graph_cost as pose_graph_cost,
    optimize_poses as optimize_poses,
)
from .submaps import SubMap as SubMap, split_trajectory as split_trajectory
