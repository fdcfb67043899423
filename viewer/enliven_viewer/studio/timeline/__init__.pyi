from .timeline_input import TimelineInput as TimelineInput
from .layout import (
    LANE_GAP as LANE_GAP,
    HEAD_HEIGHT as HEAD_HEIGHT,
    LABEL_WIDTH as LABEL_WIDTH,
    LANE_HEIGHT as LANE_HEIGHT,
    MUTE_ICON_WIDTH as MUTE_ICON_WIDTH,
    RULER_HEIGHT as RULER_HEIGHT,
    SOLO_BUTTON_WIDTH as SOLO_BUTTON_WIDTH,
    SPAN_BAND_HEIGHT as SPAN_BAND_HEIGHT,
    TAKES_BUTTON_WIDTH as TAKES_BUTTON_WIDTH,
    Lane as Lane,
    TimelineLayout as TimelineLayout,
)
from .clip_pictures import (
    SHEET_COLUMNS as SHEET_COLUMNS,
    POSE_COUNT as POSE_COUNT,
    TILE_SIZE as TILE_SIZE,
    ClipPictures as ClipPictures,
)
