from .base import NOTHING as NOTHING, Pointer as Pointer, Tool as Tool, ToolPicture as ToolPicture
from .map import MapTool as MapTool
from .nodes import remove_joint as remove_joint
from .paint import (
    BRUSHES as BRUSHES,
    LARGEST as LARGEST,
    SMALLEST as SMALLEST,
    STEP as STEP,
    PaintTool as PaintTool,
)
from .registry import TOOLS as TOOLS
