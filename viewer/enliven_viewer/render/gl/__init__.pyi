from .context import offscreen_context, window_context
from .program import BLOCKS, UNITS, load_program, set_uniform
from .region import Region, full_region
from .targets import RenderTarget, Size, SoftMap, reach_of

__all__ = [
    "BLOCKS",
    "UNITS",
    "Region",
    "RenderTarget",
    "Size",
    "SoftMap",
    "full_region",
    "load_program",
    "offscreen_context",
    "reach_of",
    "set_uniform",
    "window_context",
]
