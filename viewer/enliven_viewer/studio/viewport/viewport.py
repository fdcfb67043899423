"""The 3D view of the studio: shapes drawn by the viewer's renderer, with skeletons over them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import moderngl
import numpy as np

from enliven_viewer.playback.document import find_bounds
from enliven_viewer.render.gl.targets import RenderTarget
from enliven_viewer.render.overlay.tubes import Tubes
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import PLAIN, Scene, SceneCharacter
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.viewport.overlay import EMPTY_PICTURE, Overlay, ToolPicture
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.studio.viewport.puppet_overlay import PuppetOverlay
from enliven_viewer.studio.viewport.selection import Selection
from enliven_viewer.studio.viewport.skeletons import make_skeleton_rows
from enliven_viewer.studio.viewport.stage_character import StageCharacter


class RenderPass:
    """Geometry that is drawn into the image of the 3D view, with its camera and depth buffer.

    A method that draws must resolve the image. The methods of this base class draw nothing.
    """

    def draw(self, picture: RenderTarget) -> None:
        """Draws over the characters, below the marks of the tool and the bones."""

    def draw_above_bones(self, picture: RenderTarget) -> None:
        """Draws over the bones."""


class Viewport:
    """A view of the studio's characters, drawn into the render target of :attr:`renderer`.

    Args:
        ctx: an OpenGL context that is current in this thread.
        size: width and height of the image in pixels.
        passes: render passes that draw over the characters in each image.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        size: tuple[int, int],
        settings: RenderSettings,
        passes: Sequence[RenderPass] = (),
    ) -> None:
        self.renderer = Renderer(ctx, size, settings)
        self._tubes = Tubes(ctx)
        self._puppet_overlay: PuppetOverlay | None = None
        self._passes = passes

    def draw(
        self,
        stage: Sequence[StageCharacter],
        lens: Lens,
        selection: Selection,
        overlay: Overlay,
        *,
        over: ToolPicture = EMPTY_PICTURE,
        meshes: bool = True,
        bones: bool = True,
        live: Scene | None = None,
    ) -> None:
        """Draws and resolves one image.

        ``live`` is drawn next to the project's characters.
        """
        actors = [
            SceneCharacter(character.drawn, character.pose, vertices=character.solved)
            for character in stage
            if meshes and character.drawn
        ]
        extent = find_bounds([character.extent for character in stage])
        scene = Scene(tuple(actors), (), PLAIN, extent=extent)
        if live is not None:
            scene = replace(live, actors=(*actors, *live.actors), extent=extent)
        self.renderer.draw(scene, lens.view)
        for render_pass in self._passes:
            render_pass.draw(self.renderer.picture)
        self._draw_puppet(over)
        handled = [character for character in stage if len(character.handles) and not character.has_own_tool]
        if bones and handled:
            rows = np.concatenate(
                [make_skeleton_rows(character, lens, selection, overlay) for character in handled]
            )
            places = np.concatenate([character.handles for character in handled])
            self._tubes.draw(self.renderer.picture, rows, lens.tube_bias(places))
        for render_pass in self._passes:
            render_pass.draw_above_bones(self.renderer.picture)

    def _draw_puppet(self, over: ToolPicture) -> None:
        """Draws the geometry of the active tool over the image."""
        if over is EMPTY_PICTURE:
            return
        self._puppet_overlay = self._puppet_overlay or PuppetOverlay(self.renderer.ctx)
        picture = self.renderer.picture
        if over.shade is not None:
            self._puppet_overlay.draw_shading(picture, *over.shade)
        if over.self_intersection is not None:
            self._puppet_overlay.draw_intersections(picture, *over.self_intersection)
        if over.ghost is not None:
            self._puppet_overlay.draw_outline(picture, *over.ghost)
        for rows, bias in over.tubes:
            if len(rows):
                self._tubes.draw(picture, rows, bias)
