from .base import Pointer as Pointer, Tool as Tool
from .map import MapTool as MapTool
from .nodes import remove_joint as remove_joint
from .puppet_picture import NOTHING as NOTHING, PuppetPicture as PuppetPicture, picture_of as picture_of
from .registry import TOOLS as TOOLS
