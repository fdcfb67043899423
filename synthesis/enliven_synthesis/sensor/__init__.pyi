from .handheld import HandheldPath as HandheldPath, HandheldScan as HandheldScan, looking_at as looking_at
from .noise import DepthNoise as DepthNoise
from .render import DepthRenderer as DepthRenderer
from .studio import SyntheticSettings as SyntheticSettings, SyntheticStudio as SyntheticStudio
