"""Copies textures on the GPU: mirrored, rotated for an upright monitor, or scaled."""

from __future__ import annotations

import moderngl

from enliven_viewer.render.gl.program import TEXTURE_UNITS, load_program


class PictureCopy:
    """A render pass that copies a texture.

    Args:
        ctx: the OpenGL context of source and target.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = load_program(ctx, "screen.vert", "turned.frag")
        self._quad = ctx.vertex_array(self._program, [])

    def draw(
        self,
        source: moderngl.Texture,
        target: moderngl.Framebuffer,
        size: tuple[int, int],
        *,
        mirrored: bool = False,
        turn: int = 0,
    ) -> None:
        """Draws the source over the whole target.

        Args:
            size: width and height of the target in pixels.
            turn: clockwise rotation in degrees: 0, 90, 180 or 270.
        """
        target.viewport = (0, 0, *size)
        target.use()
        self._ctx.enable_only(moderngl.NOTHING)
        self._program["size"] = size
        self._program["mirrored"] = mirrored
        self._program["quarters"] = turn // 90
        source.use(TEXTURE_UNITS["picture"])
        self._quad.render(moderngl.TRIANGLES, vertices=3)
