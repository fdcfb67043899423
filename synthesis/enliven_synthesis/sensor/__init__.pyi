from .noise import DepthNoise
from .render import DepthRenderer
from .studio import SyntheticSettings, SyntheticStudio

__all__ = ["DepthNoise", "DepthRenderer", "SyntheticSettings", "SyntheticStudio"]
