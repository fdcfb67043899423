from .drag import TimelineInput as TimelineInput
from .layout import (
    LABELS as LABELS,
    LANE as LANE,
    RULER as RULER,
    Bar as Bar,
    TimelineLayout as TimelineLayout,
)
from .puppet_lanes import LaneRow as LaneRow, PuppetLanes as PuppetLanes
