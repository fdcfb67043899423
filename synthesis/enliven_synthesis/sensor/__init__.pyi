from .noise import DepthNoise
from .render import Renderer
from .studio import Studio, StudioSettings

__all__ = ["DepthNoise", "Renderer", "Studio", "StudioSettings"]
