"""Flat shapes and text over a picture: rounded rectangles, discs and lines of text in one draw call."""

from __future__ import annotations

import moderngl
import numpy as np

from enliven.arrays import Float
from enliven_viewer.render.gl import UNITS, load_program
from enliven_viewer.render.overlay.font import make_atlas

Colour = tuple[float, float, float, float]
"""sRGB and opacity, 0..1 each."""

_CORNERS = np.array([[0, 0], [1, 0], [0, 1], [0, 1], [1, 0], [1, 1]], np.float64)


class Canvas:
    """Collects shapes, positions in pixels from the top left, and draws them.

    Args:
        sizes: the sizes of text in use, pixels; another size takes the nearest of them.
    """

    def __init__(self, ctx: moderngl.Context, sizes: tuple[int, ...]) -> None:
        self.ctx = ctx
        coverage, self._faces = make_atlas(sizes)
        self._atlas = ctx.texture((coverage.shape[1], coverage.shape[0]), 1, coverage.tobytes(), alignment=1)
        self._atlas.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._program = load_program(ctx, "canvas.vert", "canvas.frag")
        self._buffer = ctx.buffer(reserve=11 * 4 * 6 * 256, dynamic=True)
        self._array = ctx.vertex_array(
            self._program, [(self._buffer, "2f 2f 4f 3f", "in_position", "in_uv", "in_tint", "in_box")]
        )
        self._quads: list[np.ndarray] = []

    def release(self) -> None:
        """Give the GPU's memory back."""
        for item in (self._array, self._buffer, self._atlas, self._program):
            item.release()

    def rectangle(
        self, x: float, y: float, width: float, height: float, colour: Colour, radius: float = 0.0
    ) -> None:
        """A rectangle with round corners; ``x``, ``y`` is its top left."""
        if width <= 0 or height <= 0:
            return
        half = np.array([width, height]) / 2
        local = (2 * _CORNERS - 1) * (half + 1)
        rows = np.empty((6, 11))
        rows[:, 0:2] = local + half + [x, y]
        rows[:, 2:4] = local
        rows[:, 4:8] = colour
        rows[:, 8:11] = (*half, min(radius, float(half.min())))
        self._quads.append(rows)

    def disc(self, x: float, y: float, radius: float, colour: Colour) -> None:
        """A disc around ``x``, ``y``."""
        self.rectangle(x - radius, y - radius, 2 * radius, 2 * radius, colour, radius)

    def line(self, start: Float, end: Float, width: float, colour: Colour) -> None:
        """A line with round ends between two points, (2,) each."""
        along = end - start
        length = float(np.linalg.norm(along))
        if length <= 0.0:
            self.disc(float(start[0]), float(start[1]), width / 2, colour)
            return
        along = along / length
        half = np.array([length + width, width]) / 2
        local = (2 * _CORNERS - 1) * (half + 1)
        rows = np.empty((6, 11))
        rows[:, 0:2] = local @ np.array([along, [-along[1], along[0]]]) + (start + end) / 2
        rows[:, 2:4] = local
        rows[:, 4:8] = colour
        rows[:, 8:11] = (*half, width / 2)
        self._quads.append(rows)

    def text(self, x: float, y: float, text: str, size: int, colour: Colour, align: float = 0.0) -> float:
        """Add a line of text below ``y``; ``align`` 0 starts, 0.5 centres, 1 ends it at ``x``.

        Returns:
            its width in pixels.
        """
        face = self._faces[min(self._faces, key=lambda s: abs(s - size))]
        width = face.width(text)
        pen = x - align * width
        for character in text:
            glyph = face.glyph(character)
            corner = np.array([round(pen) + glyph.left, round(y) + glyph.top])
            size_ = np.array([glyph.width, glyph.height])
            rows = np.empty((6, 11))
            rows[:, 0:2] = corner + _CORNERS * size_
            rows[:, 2:4] = [glyph.x, glyph.y] + _CORNERS * size_
            rows[:, 4:8] = colour
            rows[:, 8:11] = (0.0, 0.0, -1.0)
            self._quads.append(rows)
            pen += glyph.advance
        return width

    def width(self, text: str, size: int) -> float:
        """Pixels that a line of text takes."""
        return self._faces[min(self._faces, key=lambda s: abs(s - size))].width(text)

    def line_height(self, size: int) -> int:
        """Pixels from one line of text to the next."""
        return self._faces[min(self._faces, key=lambda s: abs(s - size))].line

    def draw(self, target: moderngl.Framebuffer) -> None:
        """Draw everything that was collected onto a framebuffer, and begin anew."""
        if not self._quads:
            return
        data = np.concatenate(self._quads).astype("f4").tobytes()
        count, self._quads = 6 * len(self._quads), []
        self._buffer.orphan(len(data))
        self._buffer.write(data)
        target.use()
        self.ctx.enable_only(moderngl.BLEND)
        self.ctx.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
        self.ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._atlas.use(UNITS["glyphs"])
        self._program["viewport"] = (float(target.width), float(target.height))
        self._array.render(moderngl.TRIANGLES, vertices=count)
