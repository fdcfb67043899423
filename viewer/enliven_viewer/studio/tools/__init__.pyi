from .base import NOTHING as NOTHING, Pointer as Pointer, Tool as Tool, ToolPicture as ToolPicture
from .map import MapTool as MapTool
from .nodes import remove_joint as remove_joint
from .registry import TOOLS as TOOLS
