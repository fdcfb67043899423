from .rig import Rig as Rig, on_floor as on_floor, playing as playing, resized as resized, welded as welded
from .rig_links import LinkBody as LinkBody
from .rig_tree import (
    Tree as Tree,
    clip_tracks as clip_tracks,
    joint_drift as joint_drift,
    tree_of as tree_of,
)
