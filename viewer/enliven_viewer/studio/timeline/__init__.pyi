from .drag import TimelineInput
from .layout import LABELS, LANE, RULER, Bar, TimelineLayout
from .puppet_lanes import LaneRow, PuppetLanes

__all__ = ["LABELS", "LANE", "RULER", "Bar", "LaneRow", "PuppetLanes", "TimelineInput", "TimelineLayout"]
