"""Flat shapes and text over an image, drawn by ImGui: rounded rectangles, discs, lines and text."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import moderngl
from imgui_bundle import hello_imgui, imgui

from enliven.arrays import Float
from enliven_viewer.theme import FONT, Colour


class Pen:
    """A pen for an ImGui draw list. Positions are pixels from an origin.

    Args:
        draw: the draw list.
        origin: left and top in pixels.
    """

    def __init__(self, draw: Any = None, origin: tuple[float, float] = (0.0, 0.0)) -> None:
        self._list, self._origin = draw, origin

    def rectangle(
        self, x: float, y: float, width: float, height: float, colour: Colour, radius: float = 0.0
    ) -> None:
        """Draws a rounded rectangle with its top left corner at ``x``, ``y``."""
        self._list.add_rect_filled(
            self._at(x, y), self._at(x + width, y + height), _pack_colour(colour), radius
        )

    def disc(self, x: float, y: float, radius: float, colour: Colour) -> None:
        """Draws a disc centred at ``x``, ``y``."""
        self._list.add_circle_filled(self._at(x, y), radius, _pack_colour(colour))

    def line(self, points: Float, width: float, colour: Colour) -> None:
        """Draws a polyline through points (N, 2), with round ends."""
        self._list.add_polyline((points + self._origin).tolist(), _pack_colour(colour), width, 0)
        for x, y in points[[0, -1]].tolist():
            self.disc(x, y, width / 2, colour)

    def text(
        self, x: float, y: float, text: str, size: int, colour: Colour, align: float = 0.0, wrap: float = 0.0
    ) -> float:
        """Draws text with its top at ``y``. It starts at ``x`` (``align`` 0), is centred at ``x`` (0.5) or
        ends at ``x`` (1).

        Args:
            wrap: maximum line width in pixels, broken between words; 0 for one line.

        Returns:
            The text's height in pixels.
        """
        width, height = self.extent(text, size, wrap)
        at = self._at(round(x - align * width), round(y))
        self._list.add_text(imgui.get_font(), size, at, _pack_colour(colour), text, wrap)
        return height

    def extent(self, text: str, size: int, wrap: float = 0.0) -> tuple[float, float]:
        """Returns width and height of a text in pixels, with lines of at most ``wrap`` pixels.

        A ``wrap`` of 0 means a single line.
        """
        imgui.push_font(None, size)
        width, height = imgui.calc_text_size(text, wrap_width=wrap or -1.0)
        imgui.pop_font()
        return width, height

    def _at(self, x: float, y: float) -> tuple[float, float]:
        return x + self._origin[0], y + self._origin[1]


class Canvas(Pen):
    """An ImGui context for one OpenGL context. Positions are pixels from the image's top left.

    Shapes and text are added inside :meth:`over`, which draws them when it ends.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        super().__init__()
        self.ctx = ctx
        self._imgui = imgui.create_context()
        imgui.set_current_context(self._imgui)
        io = imgui.get_io()
        io.set_ini_filename("")
        io.fonts.add_font_from_file_ttf(hello_imgui.asset_file_full_path(FONT), 16.0)
        imgui.backends.opengl3_init("#version 330")

    def release(self) -> None:
        """Frees the GPU memory."""
        imgui.set_current_context(self._imgui)
        imgui.backends.opengl3_shutdown()
        imgui.destroy_context(self._imgui)

    @contextmanager
    def draw_over(self, target: moderngl.Framebuffer) -> Iterator[None]:
        """Draws everything that is added inside this context onto a framebuffer."""
        imgui.set_current_context(self._imgui)
        imgui.get_io().display_size = target.size
        imgui.backends.opengl3_new_frame()
        imgui.new_frame()
        self._list = imgui.get_background_draw_list()
        yield
        imgui.render()
        target.use()
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())


def _pack_colour(colour: Colour) -> int:
    return imgui.color_convert_float4_to_u32((colour[0], colour[1], colour[2], colour[3]))
