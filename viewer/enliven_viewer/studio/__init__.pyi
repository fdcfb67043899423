from .settings import StudioSettings
from .window import StudioWindow

__all__ = ["StudioSettings", "StudioWindow"]
