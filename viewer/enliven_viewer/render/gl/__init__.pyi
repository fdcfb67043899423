from .context import offscreen_context as offscreen_context, window_context as window_context
from .program import (
    BLOCKS as BLOCKS,
    UNITS as UNITS,
    load_program as load_program,
    set_uniform as set_uniform,
)
from .region import Region as Region, full_region as full_region
from .targets import RenderTarget as RenderTarget, Size as Size, SoftMap as SoftMap, reach_of as reach_of
