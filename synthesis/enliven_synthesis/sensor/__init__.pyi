from .noise import DepthNoise as DepthNoise
from .render import DepthRenderer as DepthRenderer
from .studio import SyntheticSettings as SyntheticSettings, SyntheticStudio as SyntheticStudio
