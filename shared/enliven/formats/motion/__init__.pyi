from .added_pose import (
    count_added_frames as count_added_frames,
    added_frame_notes as added_frame_notes,
    without_added_poses as without_added_poses,
)
from .bvh import read_bvh as read_bvh
from .capture import UNITS as UNITS, Capture as Capture, guess_unit as guess_unit
from .expmap import COLUMNS as COLUMNS, read_expmap as read_expmap
