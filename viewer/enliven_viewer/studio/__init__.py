"""The studio: the editor's window, where shapes are sketched, cut, merged, posed and played."""

from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window import StudioWindow

__all__ = ["StudioSettings", "StudioWindow"]
