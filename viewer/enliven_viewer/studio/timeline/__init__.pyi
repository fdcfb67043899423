from .drag import TimelineInput as TimelineInput
from .layout import (
    GAP as GAP,
    LABELS as LABELS,
    LANE as LANE,
    RULER as RULER,
    Lane as Lane,
    TimelineLayout as TimelineLayout,
)
