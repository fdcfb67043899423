from .timeline_input import TimelineInput as TimelineInput
from .layout import (
    GAP as GAP,
    HEAD as HEAD,
    LABELS as LABELS,
    LANE as LANE,
    MUTE as MUTE,
    RULER as RULER,
    SOLO as SOLO,
    SPAN as SPAN,
    TAKES as TAKES,
    Lane as Lane,
    TimelineLayout as TimelineLayout,
)
from .clip_pictures import COLUMNS as COLUMNS, POSES as POSES, TILE as TILE, ClipPictures as ClipPictures
