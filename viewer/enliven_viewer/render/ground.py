"""The floor and the backdrop. They have no edges, so one sample per pixel is enough."""

from __future__ import annotations

import moderngl
import numpy as np

from enliven.arrays import Float
from enliven_viewer.render.gl.program import load_program

STAGE_RADIUS = 1.9
"""Radius of the pool of light in metres."""
_FLOOR_RADIUS = (
    3.0 * STAGE_RADIUS
)  # Beyond this distance, shaders/floor.frag fades the ground into the horizon.
_CELL_CORNERS = np.arange(9).reshape(3, 3) + np.arange(3)[:, None]
"""(3, 3) index of the first corner of each cell in a grid of 4 by 4 corners."""

Patch = tuple[Float, Float]
"""Lowest and highest x and z, (2,) each, in metres: a rectangle of the floor."""


class GroundPass:
    """The render pass of the floor and the backdrop.

    Only a patch of the floor can be in shadow. Outside of it the shadow maps are not sampled.

    Args:
        ctx: the renderer's context.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx = ctx
        self._corners = ctx.buffer(reserve=16 * 2 * 4, dynamic=True)
        self._floor = []
        is_inside = np.zeros((3, 3), bool)
        is_inside[1, 1] = True
        for cells, defines in ((_CELL_CORNERS[~is_inside], ()), (_CELL_CORNERS[is_inside], ("SHADED",))):
            faces = (cells[:, None] + [0, 1, 4, 4, 1, 5]).astype(np.int32)
            program = load_program(ctx, "floor.vert", "floor.frag", defines=defines)
            content = [(self._corners, "2f", "in_place")]
            self._floor.append(ctx.vertex_array(program, content, index_buffer=ctx.buffer(faces.tobytes())))
        self._backdrop = ctx.vertex_array(load_program(ctx, "backdrop.vert", "backdrop.frag"), [])

    def draw(self, target: moderngl.Framebuffer, stage: Float, shaded: Patch) -> None:
        """Draws the floor into a framebuffer, then the backdrop into the remaining pixels.

        Args:
            stage: (3,) metres, the centre of the pool of light.
            shaded: patch that contains all shadows on the floor.
        """
        middle = stage[[0, 2]]
        inner = np.clip(shaded, middle - _FLOOR_RADIUS, middle + _FLOOR_RADIUS)
        lines = np.stack(
            [middle - _FLOOR_RADIUS, *inner, middle + _FLOOR_RADIUS]
        )  # x and z coordinates of the grid lines
        places = np.stack(np.meshgrid(lines[:, 0], lines[:, 1], indexing="ij"), -1)
        self._corners.write(places.astype(np.float32).tobytes())
        target.use()
        target.clear(0.0, 0.0, 0.0, 1.0, depth=1.0)
        self.ctx.depth_func = "<="
        self.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        for cells in self._floor:
            cells.render(moderngl.TRIANGLES)
        self.ctx.enable_only(moderngl.DEPTH_TEST)
        self._backdrop.render(moderngl.TRIANGLES, vertices=3)
