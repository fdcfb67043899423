"""Draws a graph as tubes and balls over a finished image. Parts that the mesh occludes are fainter."""

from __future__ import annotations

import moderngl
import numpy as np

from enliven.arrays import Float, Float32
from enliven_viewer.render.capsules import CapsulePass
from enliven_viewer.render.gl.program import load_program
from enliven_viewer.render.gl.targets import RenderTarget

OCCLUDED_OPACITY = 0.2
"""Opacity of occluded parts."""


def make_tube_rows(starts: Float, ends: Float, radii: Float, tints: Float32) -> Float32:
    """Returns (N, 12) float32 rows for :class:`Tubes`.

    A row has start xyz and radius, end xyz and radius, rgb and opacity.

    Args:
        starts, ends: (N, 3) metres; equal points make a ball.
        radii: (N,) metres.
        tints: (N, 3) linear RGB.
    """
    rows = np.ones((len(starts), 12), np.float32)
    rows[:, 0:3], rows[:, 3] = starts, radii
    rows[:, 4:7], rows[:, 7] = ends, radii
    rows[:, 8:11] = tints
    return rows


class Tubes:
    """A render pass that draws tubes over the last image of a renderer, with the same camera.

    Args:
        ctx: the renderer's context.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx = ctx
        self._program = load_program(ctx, "tube.vert", "tube.frag")
        self._capsules = CapsulePass(ctx, self._program)

    def draw(self, picture: RenderTarget, rows: Float32, bias: float) -> None:
        """Draws the (N, 12) rows of :func:`make_tube_rows`, and resolves the image.

        Args:
            bias: depth in metres below a surface up to which a tube is fully visible, such as a bone inside a
                round limb.
        """
        picture.allow_whole_image()
        self.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE | moderngl.BLEND)
        self.ctx.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
        self.ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._program["bias"] = bias
        for test, opacity in ((">", OCCLUDED_OPACITY), ("<=", 1.0)):
            self.ctx.depth_func = test
            picture.write_depth(test == "<=")
            rows[:, 11] = opacity
            self._capsules.load(rows)
            self._capsules.render()
        picture.resolve()
