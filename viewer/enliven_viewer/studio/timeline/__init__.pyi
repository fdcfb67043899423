from .drag import TimelineHand
from .layout import LABELS, LANE, RULER, Bar, TimelineLayout
from .puppet_lanes import PuppetLanes, Row

__all__ = ["LABELS", "LANE", "RULER", "Bar", "PuppetLanes", "Row", "TimelineHand", "TimelineLayout"]
