from .loop_detection import LoopClosure as LoopClosure, correct_trajectory as correct_trajectory
from .history import FrameHistory as FrameHistory
from .pose_graph import PoseLink as PoseLink, cost_of as cost_of, settled as settled
from .submaps import SubMap as SubMap, split_way as split_way
