"""The tools of the studio: small state machines that pointer and keys drive, one module each."""

from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.tools.map import Map
from enliven_viewer.studio.tools.nodes import remove
from enliven_viewer.studio.tools.puppet_picture import NOTHING, PuppetPicture, picture_of
from enliven_viewer.studio.tools.registry import TOOLS

__all__ = ["NOTHING", "TOOLS", "Map", "Pointer", "PuppetPicture", "Tool", "picture_of", "remove"]
