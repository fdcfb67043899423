"""Framebuffers: an image that is multisampled only in regions with edges, and blurred maps for
soft shadows.
"""

from __future__ import annotations

import math

import moderngl
import numpy as np

from enliven.arrays import UInt8
from enliven_viewer.render.gl.program import TEXTURE_UNITS, load_program
from enliven_viewer.render.gl.region import Region, full_region, regions_around

Size = tuple[int, int]
_OUTER_TAP_DISTANCE = 3.23
"""Distance of the outermost tap in shaders/blur.frag from the centre, in tap spacings."""


class RenderTarget:
    """An image to read, draw over or show, with a multisampled framebuffer for regions with edges.

    The ground is drawn with one sample per pixel. In regions with objects in front of it, the ground is
    copied into the multisampled framebuffer :attr:`drawn`, the objects are drawn there, and the samples are
    averaged back. Without multisampling, both are one framebuffer.

    Args:
        size: width and height in pixels, at least 1.
        samples: samples per pixel; limited to what the context supports.
    """

    def __init__(self, ctx: moderngl.Context, size: Size, samples: int) -> None:
        self.ctx, self.size = ctx, size
        self.samples = _limit_samples(ctx, samples)
        self.texture = ctx.texture(size, 4)
        depth_buffer = ctx.depth_renderbuffer(size)
        self.ground = self.drawn = self.resolved = ctx.framebuffer([self.texture], depth_buffer)
        self._own: list[object] = [self.texture, depth_buffer, self.ground]
        self.region = full_region(size)
        self._seen: tuple[moderngl.Texture, moderngl.Framebuffer] | None = None
        if self.samples:
            colour = ctx.renderbuffer(size, 4, samples=self.samples)
            depth = ctx.depth_renderbuffer(size, samples=self.samples)
            self.drawn = ctx.framebuffer([colour], depth)
            # This framebuffer has no depth buffer, because the copy would average depths as well.
            self.resolved = ctx.framebuffer([self.texture])
            self._own += [colour, depth, self.drawn, self.resolved]

    def begin(self, region: Region) -> None:
        """Begins drawing in front of the ground, in one region of the image, until :meth:`resolve`."""
        self.region = region
        self._copy_to_samples(region)
        self.drawn.use()

    def write_depth(self, on: bool) -> None:
        """Turns writing to the depth buffer on or off. moderngl applies the mask when binding."""
        self.drawn.depth_mask = on
        self.drawn.use()

    def allow_whole_image(self) -> None:
        """Removes the restriction to the region until the next :meth:`resolve`."""
        for outer_region in regions_around(self.region, self.size):
            self._copy_to_samples(outer_region)
        self.region = self.drawn.scissor = full_region(self.size)
        self.drawn.use()

    def _copy_to_samples(self, region: Region) -> None:
        """Copies the ground and its depth into the samples of a region."""
        if self.drawn is not self.ground:
            self.drawn.scissor = region
            self.drawn.use()
            self.ctx.copy_framebuffer(self.drawn, self.ground)

    def resolve(self) -> None:
        """Averages the samples of the region into the image."""
        if self.drawn is not self.resolved:
            self.drawn.use()  # Bind the source first, because its scissor region limits the copy.
            self.ctx.copy_framebuffer(self.resolved, self.drawn)
            # Bind the target too. Otherwise the next framebuffer would be cleared only in this region.
            self.resolved.use()

    def copy_as_texture(self) -> moderngl.Texture:
        """Returns the current image as a texture, which the next transparent meshes sample as their
        background.
        """
        if self.drawn is not self.ground:
            self.resolve()
            self.drawn.use()
            return self.texture
        if self._seen is None:
            copied = self.ctx.texture(self.size, 4)
            self._seen = copied, self.ctx.framebuffer([copied])
            self._own += self._seen
        self.ctx.copy_framebuffer(self._seen[1], self.drawn)
        return self._seen[0]

    def pixels(self) -> UInt8:
        """Returns (H, W, 3) sRGB of the resolved image, top row first."""
        return flip_rows(self.read_raw())

    def read_raw(self) -> UInt8:
        """Returns the resolved image (H, W, 4) as stored by OpenGL, bottom row first."""
        width, height = self.size
        return np.frombuffer(self.resolved.read(components=4), np.uint8).reshape(height, width, 4)

    def release(self) -> None:
        """Frees the GPU memory."""
        for item in reversed(self._own):
            item.release()  # type: ignore[attr-defined]


def flip_rows(raw: UInt8) -> UInt8:
    """Returns (H, W, 3) sRGB, top row first, of an image (H, W, 4) as stored by OpenGL."""
    return np.ascontiguousarray(raw[::-1, :, :3])


def _limit_samples(ctx: moderngl.Context, wanted: int) -> int:
    """Returns the largest supported number of samples up to ``wanted``, or 0 for none."""
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
        """Returns the blurred map."""
        return self._maps[0]

    def begin(self, value: float) -> None:
        """Clears to (value, value) and makes the map the render target until :meth:`blur`."""
        for buffer in reversed(self._buffers):
            buffer.scissor = full_region((self.size, self.size))
            buffer.use()
            self.ctx.clear(value, value, value, value, depth=1.0)
        self.ctx.enable_only(moderngl.DEPTH_TEST)
        self.ctx.depth_func = "<"

    def blur(self, widths: tuple[float, ...], drawn: Region) -> None:
        """Applies nine-tap Gaussian blurs one after the other, with taps ``widths`` texels apart.

        Args:
            drawn: region that contains the drawing after the blur, enlarged by :func:`count_spread_texels`.
        """
        self.ctx.enable_only(moderngl.NOTHING)
        for buffer in self._buffers:
            buffer.scissor = drawn
        for width in widths:
            for source, step in ((0, (width / self.size, 0.0)), (1, (0.0, width / self.size))):
                self._maps[source].use(TEXTURE_UNITS["source"])
                self._buffers[1 - source].use()
                self._blur["direction"] = step
                self._quad.render(moderngl.TRIANGLES, vertices=3)


def count_spread_texels(widths: tuple[float, ...]) -> int:
    """Returns the distance in texels over which :meth:`SoftMap.blur` spreads a drawing."""
    return sum(math.ceil(_OUTER_TAP_DISTANCE * width) + 1 for width in widths)
