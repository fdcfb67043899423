"""The tools, in the order of their buttons."""

from __future__ import annotations

from enliven_viewer.studio.tools.base import Tool
from enliven_viewer.studio.tools.cut import CutTool
from enliven_viewer.studio.tools.limb_ends import LimbEndsTool
from enliven_viewer.studio.tools.move import MoveTool
from enliven_viewer.studio.tools.nodes import InsertTool, RemoveTool
from enliven_viewer.studio.tools.pose import PoseTool
from enliven_viewer.studio.tools.select import SelectTool
from enliven_viewer.studio.tools.sketch import SketchTool

TOOLS: tuple[type[Tool], ...] = (
    SelectTool,
    SketchTool,
    MoveTool,
    PoseTool,
    InsertTool,
    RemoveTool,
    CutTool,
    LimbEndsTool,
)
"""The built-in tools of the studio. Features add further tools."""
