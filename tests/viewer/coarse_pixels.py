"""Draws a window with few pixels while its picture does not matter: software OpenGL costs by the pixel."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

from imgui_bundle import ImVec2, imgui

from enliven_viewer.studio.desktop import Desktop
from enliven_viewer.studio.pictures import WindowPictures
from enliven_viewer.studio.places import Area

SHARE = 0.125
"""Pixels drawn over usual pixels, each way: what is laid out, hovered and clicked stays the same."""
EVERY = 8
"""Pictures of a window for each picture of the scene behind its panels. The scene was two thirds of their cost;
a menu is open for longer than this, so that whatever an action leaves there is still drawn."""


@contextmanager
def coarse_pixels(fine: Callable[[], bool] = lambda: False) -> Iterator[None]:
    """Lets every window draw a 64th of its pixels, and the scene at times, until the end, but while ``fine()``."""
    lay_out, draw, pictures = Desktop.lay_out, WindowPictures.draw, count()

    def seldom(self: WindowPictures, area: Area) -> None:
        if fine() or next(pictures) % EVERY == 0:
            draw(self, area)

    def coarse(self: Desktop) -> None:
        lay_out(self)
        if fine():
            return
        io, view = imgui.get_io(), imgui.get_main_viewport()
        dense = io.display_framebuffer_scale
        io.display_framebuffer_scale = view.framebuffer_scale = ImVec2(dense.x * SHARE, dense.y * SHARE)

    Desktop.lay_out = coarse  # type: ignore[method-assign]
    WindowPictures.draw = seldom  # type: ignore[method-assign]
    try:
        yield
    finally:
        Desktop.lay_out = lay_out  # type: ignore[method-assign]
        WindowPictures.draw = draw  # type: ignore[method-assign]
