from .base import Pointer, Tool
from .map import MapTool
from .nodes import remove_joint
from .puppet_picture import NOTHING, PuppetPicture, picture_of
from .registry import TOOLS

__all__ = ["NOTHING", "TOOLS", "MapTool", "Pointer", "PuppetPicture", "Tool", "picture_of", "remove_joint"]
