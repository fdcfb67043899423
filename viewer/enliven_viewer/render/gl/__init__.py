"""OpenGL 3.3 core: contexts, shader programs and framebuffers."""

from enliven_viewer.render.gl.context import offscreen_context, window_context
from enliven_viewer.render.gl.program import BLOCKS, UNITS, load_program, set_uniform
from enliven_viewer.render.gl.region import Region, whole
from enliven_viewer.render.gl.targets import Picture, Size, SoftMap, reach_of

__all__ = [
    "BLOCKS",
    "UNITS",
    "Picture",
    "Region",
    "Size",
    "SoftMap",
    "load_program",
    "offscreen_context",
    "reach_of",
    "set_uniform",
    "whole",
    "window_context",
]
