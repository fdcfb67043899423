"""The floor and the backdrop: smooth pictures that need one sample a pixel, and their copy under the rest."""

from __future__ import annotations

import moderngl
import numpy as np

from enliven_viewer.render.program import UNITS, load_program
from enliven_viewer.render.targets import Picture

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
        square = ctx.buffer(_SQUARE.tobytes())
        self._quads = []
        for fragments in (("floor.frag", "backdrop.frag"), ("present.frag", "present.frag")):
            floor = load_program(ctx, "floor.vert", fragments[0])
            floor["reach"] = _REACH
            backdrop = load_program(ctx, "screen.vert", fragments[1])
            self._quads.append(
                (ctx.vertex_array(floor, [(square, "2f", "in_corner")]), ctx.vertex_array(backdrop, []))
            )

    def draw(self, picture: Picture) -> None:
        """Fill the picture, one sample a pixel; their own edges lie where both have the same colour."""
        picture.ground.use()
        picture.ground.clear(0.0, 0.0, 0.0, 1.0, depth=1.0)
        self._render(0)

    def copy(self, picture: Picture) -> None:
        """Fill :attr:`Picture.drawn`, as far as it is open, with what the picture shows, and with depth."""
        picture.drawn.clear(0.0, 0.0, 0.0, 1.0, depth=1.0)
        picture.texture.use(UNITS["picture"])
        self._render(1)

    def _render(self, number: int) -> None:
        """The floor, then the backdrop where it leaves room."""
        floor, backdrop = self._quads[number]
        self.ctx.depth_func = "<="
        self.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        floor.render(moderngl.TRIANGLE_STRIP)
        self.ctx.enable_only(moderngl.DEPTH_TEST)
        backdrop.render(moderngl.TRIANGLES, vertices=3)
