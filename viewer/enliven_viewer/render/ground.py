"""The floor and the backdrop: nothing in them has an edge, so one sample a pixel is enough."""

from __future__ import annotations

import moderngl
import numpy as np

from enliven_viewer.render.program import load_program

STAGE_RADIUS = 1.9
"""Metres, of the pool of light."""
_REACH = 3.0 * STAGE_RADIUS  # beyond, shaders/floor.frag has faded into the horizon
_SQUARE = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]], np.float32)


class Ground:
    """Draws the floor and the backdrop.

    Args:
        ctx: the renderer's context.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx = ctx
        floor = load_program(ctx, "floor.vert", "floor.frag")
        floor["reach"] = _REACH
        self._floor = ctx.vertex_array(floor, [(ctx.buffer(_SQUARE.tobytes()), "2f", "in_corner")])
        self._backdrop = ctx.vertex_array(load_program(ctx, "screen.vert", "backdrop.frag"), [])

    def draw(self, target: moderngl.Framebuffer) -> None:
        """Fill a framebuffer: the floor, then the backdrop where it leaves room."""
        target.use()
        target.clear(0.0, 0.0, 0.0, 1.0, depth=1.0)
        self.ctx.depth_func = "<="
        self.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._floor.render(moderngl.TRIANGLE_STRIP)
        self.ctx.enable_only(moderngl.DEPTH_TEST)
        self._backdrop.render(moderngl.TRIANGLES, vertices=3)
