from .context import (
    create_offscreen_context as create_offscreen_context,
    get_window_context as get_window_context,
)
from .program import (
    BLOCK_BINDINGS as BLOCK_BINDINGS,
    TEXTURE_UNITS as TEXTURE_UNITS,
    load_program as load_program,
    set_uniform as set_uniform,
)
from .region import Region as Region, full_region as full_region
from .targets import (
    RenderTarget as RenderTarget,
    Size as Size,
    SoftMap as SoftMap,
    count_spread_texels as count_spread_texels,
)
