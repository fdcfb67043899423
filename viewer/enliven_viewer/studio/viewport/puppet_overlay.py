"""Draws overlays on the rendered meshes: the outline of another pose, self-intersecting faces, and painted
stiffness.
"""

from __future__ import annotations

import moderngl
import numpy as np

from enliven.arrays import Float, Float32, Int32, UInt8
from enliven_viewer.render.gl.program import TEXTURE_UNITS, load_program
from enliven_viewer.render.gl.targets import RenderTarget
from enliven_viewer.theme import GHOST, WARNING, Paint

_OUTLINE_WIDTH_PX = 2.0
"""Line width of the outline in pixels."""
_MIN_DEPTH_STEP = 0.06
"""The outline is drawn at depth discontinuities larger than this fraction of the mesh's size."""


class PuppetOverlay:
    """A render pass that draws over the last image of a renderer, with the same camera.

    Args:
        ctx: the renderer's context.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx = ctx
        self._ghost = load_program(ctx, "ghost.vert", "ghost.frag")
        self._outline = load_program(ctx, "screen.vert", "outline.frag")
        self._quad = ctx.vertex_array(self._outline, [])
        self._warning = load_program(ctx, "warning.vert", "warning.frag")
        self._shade = load_program(ctx, "shade.vert", "shade.frag")
        self._mask: tuple[moderngl.Texture, moderngl.Framebuffer] | None = None
        self._mesh: tuple[object, object, list[moderngl.Buffer], moderngl.VertexArray] | None = None

    def draw_outline(self, picture: RenderTarget, vertices: Float32, faces: Int32, size: float) -> None:
        """Draws the outline of a mesh (V, 3) metres in the world over everything.

        `size` is the mesh's size in metres.
        """
        mask, buffer = self._get_mask(picture.size)
        buffer.use()
        buffer.clear(0.0, depth=1.0)
        self.ctx.enable_only(moderngl.DEPTH_TEST)
        self.ctx.depth_func = "<"
        self._load_mesh(vertices, faces).render(moderngl.TRIANGLES)
        picture.allow_whole_image()
        self._draw_blended(moderngl.NOTHING)
        mask.use(TEXTURE_UNITS["picture"])
        self._outline["tint"] = _convert_to_float_tint(GHOST, 0.85)
        self._outline["radius"] = _OUTLINE_WIDTH_PX
        self._outline["jump"] = _MIN_DEPTH_STEP * size
        self._quad.render(moderngl.TRIANGLES, vertices=3)
        picture.resolve()

    def draw_intersections(self, picture: RenderTarget, vertices: Float32, faces: Int32) -> None:
        """Highlights the self-intersecting faces (K, 3) of a surface.

        They are fainter where other geometry covers them.
        """
        corners = np.ascontiguousarray(vertices[faces.ravel()], np.float32)
        if not len(corners):
            return
        buffer = self.ctx.buffer(corners.tobytes())
        array = self.ctx.vertex_array(self._warning, [(buffer, "3f", "in_position")])
        picture.allow_whole_image()
        self._draw_blended(moderngl.DEPTH_TEST)
        picture.drawn.depth_mask = False
        picture.drawn.use()
        for test, opacity in ((">", 0.22), ("<=", 0.86)):
            self.ctx.depth_func = test
            self._warning["tint"] = _convert_to_float_tint(WARNING, opacity)
            array.render(moderngl.TRIANGLES)
        picture.drawn.depth_mask = True
        picture.drawn.use()
        picture.resolve()
        array.release()
        buffer.release()

    def draw_shading(
        self, picture: RenderTarget, vertices: Float | Float32, faces: Int32, tints: UInt8
    ) -> None:
        """Draws colours over a mesh (V, 3) metres in the world: (V, 4) uint8 sRGB and opacity."""
        data = (np.asarray(vertices, np.float32), tints, np.asarray(faces, np.int32))
        places, colours, order = (self.ctx.buffer(np.ascontiguousarray(values).tobytes()) for values in data)
        array = self.ctx.vertex_array(
            self._shade,
            [(places, "3f", "in_position"), (colours, "4f1", "in_tint")],
            index_buffer=order,
            index_element_size=4,
        )
        picture.allow_whole_image()
        self._draw_blended(moderngl.DEPTH_TEST)
        picture.drawn.depth_mask = False
        picture.drawn.use()
        self.ctx.depth_func = "<="
        array.render(moderngl.TRIANGLES)
        picture.drawn.depth_mask = True
        picture.drawn.use()
        picture.resolve()
        for resource in (array, places, colours, order):
            resource.release()

    def _draw_blended(self, flags: int) -> None:
        self.ctx.enable_only(moderngl.BLEND | flags)
        self.ctx.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
        self.ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA

    def _get_mask(self, size: tuple[int, int]) -> tuple[moderngl.Texture, moderngl.Framebuffer]:
        if self._mask is None or self._mask[0].size != size:
            if self._mask is not None:
                self._mask[1].release()
                self._mask[0].release()
            texture = self.ctx.texture(size, 1, dtype="f4")
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._mask = (texture, self.ctx.framebuffer([texture], self.ctx.depth_renderbuffer(size)))
        return self._mask

    def _load_mesh(self, vertices: Float32, faces: Int32) -> moderngl.VertexArray:
        """Returns the mesh on the GPU. The same mesh is not uploaded again."""
        if self._mesh is None or self._mesh[0] is not vertices or self._mesh[1] is not faces:
            if self._mesh is not None:
                self._mesh[3].release()
                for buffer in self._mesh[2]:
                    buffer.release()
            corners = self.ctx.buffer(np.ascontiguousarray(vertices, np.float32).tobytes())
            order = self.ctx.buffer(np.ascontiguousarray(faces, np.int32).tobytes())
            array = self.ctx.vertex_array(
                self._ghost, [(corners, "3f", "in_position")], index_buffer=order, index_element_size=4
            )
            self._mesh = (vertices, faces, [corners, order], array)
        return self._mesh[3]


def _convert_to_float_tint(colour: Paint, opacity: float) -> tuple[float, float, float, float]:
    return (colour[0] / 255, colour[1] / 255, colour[2] / 255, opacity)
