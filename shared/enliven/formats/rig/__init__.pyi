from .rig import (
    Rig as Rig,
    place_on_floor as place_on_floor,
    play_clip as play_clip,
    scale_to_height as scale_to_height,
    weld_shape as weld_shape,
)
from .rig_links import LinkBody as LinkBody
from .rig_tree import (
    Tree as Tree,
    clip_tracks as clip_tracks,
    joint_drift as joint_drift,
    build_tree as build_tree,
)
