"""The tools, in the order of their buttons."""

from __future__ import annotations

from enliven_viewer.studio.tools.base import Tool
from enliven_viewer.studio.tools.carry import Carry
from enliven_viewer.studio.tools.choose import Choose
from enliven_viewer.studio.tools.cut import Cut
from enliven_viewer.studio.tools.map import Map
from enliven_viewer.studio.tools.nodes import Insert, Remove
from enliven_viewer.studio.tools.pose import Pose
from enliven_viewer.studio.tools.puppet import PuppetTool
from enliven_viewer.studio.tools.sketch import Sketch

TOOLS: tuple[type[Tool], ...] = (Choose, Sketch, Carry, Pose, Insert, Remove, Cut, Map, PuppetTool)
"""Every tool."""
