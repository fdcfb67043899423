"""The framebuffers: a multisampled picture with its resolved copy, and blurred maps for soft shadows."""

from __future__ import annotations

import moderngl
import numpy as np

from enliven.arrays import UInt8
from enliven_viewer.render.program import UNITS, load_program

Size = tuple[int, int]


class Picture:
    """A multisampled framebuffer to draw in, and the resolved one to read, draw over or show.

    Args:
        size: width and height in pixels, at least 1.
        samples: samples a pixel; lowered to what the context has.
    """

    def __init__(self, ctx: moderngl.Context, size: Size, samples: int) -> None:
        self.ctx, self.size = ctx, size
        self.samples = _available(ctx, samples)
        self.texture = ctx.texture(size, 4)
        self.resolved = ctx.framebuffer([self.texture], ctx.depth_renderbuffer(size))
        self._own: list[object] = [self.texture, self.resolved]
        if self.samples:
            colour = ctx.renderbuffer(size, 4, samples=self.samples)
            depth = ctx.depth_renderbuffer(size, samples=self.samples)
            self.drawn = ctx.framebuffer([colour], depth)
            self._own += [colour, depth, self.drawn]
        else:
            self.drawn = self.resolved

    def resolve(self) -> None:
        """Average the samples into the resolved framebuffer."""
        if self.drawn is not self.resolved:
            self.ctx.copy_framebuffer(self.resolved, self.drawn)

    def pixels(self) -> UInt8:
        """(H, W, 3) sRGB of the resolved picture, top row first."""
        return upright(self.raw())

    def raw(self) -> UInt8:
        """(H, W, 4) the resolved picture as OpenGL keeps it, bottom row first."""
        width, height = self.size
        return np.frombuffer(self.resolved.read(components=4), np.uint8).reshape(height, width, 4)

    def release(self) -> None:
        """Give the GPU's memory back."""
        for item in reversed(self._own):
            item.release()  # type: ignore[attr-defined]


def upright(raw: UInt8) -> UInt8:
    """(H, W, 3) sRGB, top row first, of a picture as OpenGL keeps it, (H, W, 4)."""
    return np.ascontiguousarray(raw[::-1, :, :3])


def _available(ctx: moderngl.Context, wanted: int) -> int:
    """The largest number of samples up to ``wanted``; 0 for none."""
    limit = min(wanted, int(ctx.info.get("GL_MAX_SAMPLES", 0) or ctx.max_samples))
    return 0 if limit < 2 else 1 << (limit.bit_length() - 1)


class SoftMap:
    """A square map of two floats that is drawn, then blurred in two passes."""

    def __init__(self, ctx: moderngl.Context, size: int) -> None:
        self.ctx, self.size = ctx, size
        self._maps = [ctx.texture((size, size), 2, dtype="f4") for _ in range(2)]
        for texture in self._maps:
            texture.repeat_x = texture.repeat_y = False
        depth = ctx.depth_renderbuffer((size, size))
        self._buffers = [ctx.framebuffer([self._maps[0]], depth), ctx.framebuffer([self._maps[1]])]
        self._blur = load_program(ctx, "screen.vert", "blur.frag")
        self._quad = ctx.vertex_array(self._blur, [])

    @property
    def texture(self) -> moderngl.Texture:
        """The blurred map."""
        return self._maps[0]

    def begin(self, value: float) -> None:
        """Clear to (value, value) and draw here until :meth:`blur`."""
        self._buffers[0].use()
        self.ctx.clear(value, value, value, value, depth=1.0)
        self.ctx.enable_only(moderngl.DEPTH_TEST)
        self.ctx.depth_func = "<"

    def blur(self, widths: tuple[float, ...]) -> None:
        """Blur with nine-tap Gaussians whose taps are ``widths`` texels apart, one after the other."""
        self.ctx.enable_only(moderngl.NOTHING)
        for width in widths:
            for source, step in ((0, (width / self.size, 0.0)), (1, (0.0, width / self.size))):
                self._maps[source].use(UNITS["source"])
                self._buffers[1 - source].use()
                self._blur["direction"] = step
                self._quad.render(moderngl.TRIANGLES, vertices=3)
