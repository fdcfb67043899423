"""The timeline's lanes: where they are, and what a drag on them edits."""

from enliven_viewer.studio.timeline.drag import TimelineHand
from enliven_viewer.studio.timeline.layout import LABELS, LANE, RULER, Bar, TimelineLayout
from enliven_viewer.studio.timeline.puppet_lanes import PuppetLanes, Row

__all__ = ["LABELS", "LANE", "RULER", "Bar", "PuppetLanes", "Row", "TimelineHand", "TimelineLayout"]
