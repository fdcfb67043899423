"""Draws a window with few pixels while its picture does not matter: software OpenGL costs by the pixel."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from imgui_bundle import ImVec2, imgui

from enliven_viewer.studio.desktop import Desktop

SHARE = 0.125
"""Pixels drawn over usual pixels, each way: what is laid out, hovered and clicked stays the same."""


@contextmanager
def coarse_pixels(fine: Callable[[], bool] = lambda: False) -> Iterator[None]:
    """Lets every window draw a 64th of its pixels in its corner, until the end, but while ``fine()``."""
    lay_out = Desktop.lay_out

    def coarse(self: Desktop) -> None:
        lay_out(self)
        if fine():
            return
        io, view = imgui.get_io(), imgui.get_main_viewport()
        dense = io.display_framebuffer_scale
        io.display_framebuffer_scale = view.framebuffer_scale = ImVec2(dense.x * SHARE, dense.y * SHARE)

    Desktop.lay_out = coarse  # type: ignore[method-assign]
    try:
        yield
    finally:
        Desktop.lay_out = lay_out  # type: ignore[method-assign]
