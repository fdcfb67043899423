"""Draws the preview surface of a running scan; areas with few observations are hatched."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from enliven.arrays import Float, Float32, Int32, UInt8
from enliven_viewer.render.gl import RenderTarget, load_program
from enliven_viewer.theme import WAIT


@dataclass(frozen=True, eq=False)
class ScanPreview:
    """A preview surface to draw.

    Attributes:
        vertices: (V, 3) metres in its own frame.
        normals: (V, 3) unit normals.
        colours: (V, 3) uint8 sRGB.
        seen: (V,) uint8 observation quality; 255 is best.
        faces: (F, 3) int32.
    """

    vertices: Float32
    normals: Float32
    colours: UInt8
    seen: UInt8
    faces: Int32


class ScanPreviewPass:
    """A render pass that draws over the last image of a renderer, with the same camera and depth buffer.

    Args:
        ctx: the renderer's context.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = load_program(ctx, "scan.vert", "scan.frag")
        self._shown: ScanPreview | None = None
        self._buffers: list[moderngl.Buffer] = []
        self._array: moderngl.VertexArray | None = None

    def draw(self, picture: RenderTarget, shown: ScanPreview, world_from_own: Float) -> None:
        """Draws a surface with the placement (4, 4) ``world_from_own``, and resolves the image."""
        self._load(shown)
        if self._array is None:
            return
        picture.widen()
        self._ctx.enable_only(moderngl.DEPTH_TEST)
        self._ctx.depth_func = "<="
        picture.write_depth(True)
        self._program["world_from_own"] = tuple(np.asarray(world_from_own, float).T.ravel())
        self._program["hatch"] = WAIT[:3]
        self._array.render(moderngl.TRIANGLES)
        picture.resolve()

    def release(self) -> None:
        """Frees the GPU memory."""
        if self._array is not None:
            self._array.release()
        for buffer in self._buffers:
            buffer.release()
        self._array, self._buffers, self._shown = None, [], None

    def _load(self, shown: ScanPreview) -> None:
        """Uploads a surface to the GPU; the same surface is not uploaded again."""
        if shown is self._shown:
            return
        self.release()
        self._shown = shown
        if not len(shown.faces):
            return
        tints = np.concatenate([shown.colours, shown.seen[:, None]], 1)
        data = (shown.vertices.astype("f4"), shown.normals.astype("f4"), tints, shown.faces.astype("i4"))
        places, normals, colours, order = (self._ctx.buffer(np.ascontiguousarray(values)) for values in data)
        self._buffers = [places, normals, colours, order]
        self._array = self._ctx.vertex_array(
            self._program,
            [(places, "3f", "in_position"), (normals, "3f", "in_normal"), (colours, "4f1", "in_tint")],
            index_buffer=order,
            index_element_size=4,
        )
