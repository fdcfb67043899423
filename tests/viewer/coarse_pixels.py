"""Draws a window with few pixels if its image does not matter. The cost of software OpenGL is per pixel."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

from imgui_bundle import ImVec2, imgui

from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.window.desktop import Desktop
from enliven_viewer.studio.window.window_pictures import WindowPictures

SHARE = 0.125
"""Ratio of drawn to usual pixels in each direction. Layout, hovering and clicking do not change."""
EVERY = 8
"""Number of window frames per image of the scene behind the panels, which was two thirds of their cost.

A click in a menu takes more frames, so the scene is still drawn after an action.
"""


@contextmanager
def coarse_pixels(fine: Callable[[], bool] = lambda: False, every: int = EVERY) -> Iterator[None]:
    """Lets every window draw a 64th of its pixels and few images of its scene, except while ``fine()``.

    Args:
        every: number of frames for each image of the scene. 1 draws the scene in every frame.
    """
    lay_out = Desktop.lay_out

    def coarse(self: Desktop) -> None:
        lay_out(self)
        if fine():
            return
        io, view = imgui.get_io(), imgui.get_main_viewport()
        dense = io.display_framebuffer_scale
        io.display_framebuffer_scale = view.framebuffer_scale = ImVec2(dense.x * SHARE, dense.y * SHARE)

    Desktop.lay_out = coarse
    try:
        with seldom_scene(fine, every):
            yield
    finally:
        Desktop.lay_out = lay_out


@contextmanager
def seldom_scene(fine: Callable[[], bool] = lambda: False, every: int = EVERY) -> Iterator[None]:
    """Lets windows draw the scene behind their panels in one of ``every`` frames, except while ``fine()``."""
    draw, frames = WindowPictures.draw, count()

    def seldom(self: WindowPictures, area: Area) -> None:
        if fine() or next(frames) % every == 0:
            draw(self, area)

    WindowPictures.draw = seldom
    try:
        yield
    finally:
        WindowPictures.draw = draw
