"""Draws ghosts of characters (onion skins) and motion trails. A ghost is transparent, and more opaque at its
silhouette.
"""

from __future__ import annotations

import moderngl
import numpy as np

from enliven_viewer.render.gl.program import load_program
from enliven_viewer.render.gl.targets import RenderTarget
from enliven_viewer.render.overlay.tubes import Tubes
from enliven_viewer.studio.features.animation.ghost_picture import GhostBody, GhostPicture
from enliven_viewer.studio.features.animation.ghosts import Ghosts
from enliven_viewer.studio.features.animation.motion_samples import GhostSurface
from enliven_viewer.studio.viewport.viewport import RenderPass


class OnionSkin:
    """A render pass that draws ghosts over the last image of a renderer, with the same camera. Existing
    geometry occludes the ghosts.

    Args:
        ctx: the renderer's context.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx = ctx
        self._program = load_program(ctx, "onion.vert", "onion.frag")
        self._arrays: dict[GhostSurface, tuple[moderngl.VertexArray, list[moderngl.Buffer]]] = {}

    def draw(self, picture: RenderTarget, bodies: tuple[GhostBody, ...]) -> None:
        """Draws the ghosts in order, and resolves the image."""
        self._release_others({ghost.body for ghost in bodies})
        picture.allow_whole_image()
        self.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
        self.ctx.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
        self.ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        for ghost in bodies:
            if len(ghost.body.rows):
                self._draw(picture, ghost)
        picture.drawn.color_mask = True, True, True, True
        picture.drawn.use()
        picture.resolve()

    def _draw(self, picture: RenderTarget, ghost: GhostBody) -> None:
        """Draws one ghost. Writes its depth first, so that only its front faces are visible."""
        array = self._get_array(ghost)
        self._program["tint"] = tuple(part / 255 for part in ghost.tint)
        self._program["opacity"] = ghost.opacity
        for colours, test in ((False, "<"), (True, "<=")):
            picture.drawn.color_mask = colours, colours, colours, colours
            picture.drawn.use()
            self.ctx.depth_func = test
            array.render(moderngl.TRIANGLES)

    def _get_array(self, ghost: GhostBody) -> moderngl.VertexArray:
        """Returns the ghost on the GPU. The same ghost is not uploaded again."""
        if ghost.body not in self._arrays:
            rows = self.ctx.buffer(np.ascontiguousarray(ghost.body.rows).tobytes())
            faces = self.ctx.buffer(np.ascontiguousarray(ghost.body.faces, np.int32).tobytes())
            content = [(rows, "3f 3f", "in_position", "in_normal")]
            array = self.ctx.vertex_array(self._program, content, index_buffer=faces, index_element_size=4)
            self._arrays[ghost.body] = (array, [rows, faces])
        return self._arrays[ghost.body][0]

    def _release_others(self, wanted: set[GhostSurface]) -> None:
        """Frees the GPU memory of other ghosts."""
        for body in set(self._arrays) - wanted:
            array, buffers = self._arrays.pop(body)
            for resource in (array, *buffers):
                resource.release()


class GhostPass(RenderPass):
    """The layer of the view with ghosts and trails.

    Args:
        ctx: the renderer's context.
        ghosts: computes the ghosts in the background.
    """

    def __init__(self, ctx: moderngl.Context, ghosts: Ghosts) -> None:
        self._ctx, self._ghosts = ctx, ghosts
        self._picture: GhostPicture | None = None
        self._onion: OnionSkin | None = None
        self._tubes: Tubes | None = None

    def draw(self, picture: RenderTarget) -> None:
        """Draws the ghosts that have been computed."""
        self._picture = self._ghosts.picture()
        if self._picture is not None and self._picture.bodies:
            self._onion = self._onion or OnionSkin(self._ctx)
            self._onion.draw(picture, self._picture.bodies)

    def draw_above_bones(self, picture: RenderTarget) -> None:
        """Draws the trails of the same ghosts."""
        if self._picture is not None and len(self._picture.tubes):
            self._tubes = self._tubes or Tubes(self._ctx)
            bias = self._ghosts.editor.lens.tube_bias(self._picture.tubes[:, :3])
            self._tubes.draw(picture, self._picture.tubes, bias)
