from .base import EMPTY_PICTURE as EMPTY_PICTURE, Pointer as Pointer, Tool as Tool, ToolPicture as ToolPicture
from .map import MapTool as MapTool
from .nodes import remove_joint as remove_joint
from .paint import (
    BRUSHES as BRUSHES,
    MAX_RADIUS_PX as MAX_RADIUS_PX,
    MIN_RADIUS_PX as MIN_RADIUS_PX,
    RADIUS_STEP as RADIUS_STEP,
    PaintTool as PaintTool,
)
from .registry import TOOLS as TOOLS
