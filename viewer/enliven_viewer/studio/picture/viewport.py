"""The 3D view of the studio: shapes drawn by the viewer's renderer, with skeletons over them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import moderngl
import numpy as np

from enliven.arrays import Float
from enliven_viewer.playback import find_bounds
from enliven_viewer.render import PLAIN, Renderer, Scene, SceneCharacter
from enliven_viewer.render.overlay import Tubes
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.ghosts import GhostPicture
from enliven_viewer.studio.picture.onion_skin import OnionSkin
from enliven_viewer.studio.picture.scan_preview_pass import ScanPreview, ScanPreviewPass
from enliven_viewer.studio.picture.skeletons import make_skeleton_rows
from enliven_viewer.studio.puppets import PuppetOverlay
from enliven_viewer.studio.tools import EMPTY_PICTURE, ToolPicture
from enliven_viewer.studio.viewport import Lens, Overlay, Selection, StageCharacter

_DEPTH_BIAS = 0.4
"""Depth bias as a fraction of the camera distance. Bones are visible through geometry that covers them by
less.
"""


class Viewport:
    """A view of the studio's characters, drawn into the render target of :attr:`renderer`.

    Args:
        ctx: an OpenGL context that is current in this thread.
        size: width and height of the image in pixels.
    """

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int], settings: RenderSettings) -> None:
        self.renderer = Renderer(ctx, size, settings)
        self._tubes = Tubes(ctx)
        self._puppet_overlay: PuppetOverlay | None = None
        self._growing: ScanPreviewPass | None = None
        self._onion: OnionSkin | None = None

    def draw(
        self,
        stage: Sequence[StageCharacter],
        lens: Lens,
        selection: Selection,
        overlay: Overlay,
        *,
        over: ToolPicture = EMPTY_PICTURE,
        ghosts: GhostPicture | None = None,
        meshes: bool = True,
        bones: bool = True,
        live: Scene | None = None,
        growing: tuple[ScanPreview, Float] | None = None,
    ) -> None:
        """Draws and resolves one image.

        ``live`` is drawn next to the project's characters; ``growing`` is a running scan.
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
        self._draw_growing(growing)
        if ghosts is not None and ghosts.bodies:
            self._onion = self._onion or OnionSkin(self.renderer.ctx)
            self._onion.draw(self.renderer.picture, ghosts.bodies)
        self._draw_puppet(over)
        handled = [character for character in stage if len(character.handles) and not character.has_own_tool]
        if bones and handled:
            rows = np.concatenate(
                [make_skeleton_rows(character, lens, selection, overlay) for character in handled]
            )
            near = min(
                float(((character.handles - lens.view.eye) @ lens.forward).min()) for character in handled
            )
            self._tubes.draw(self.renderer.picture, rows, _DEPTH_BIAS * max(near, 0.05))
        if ghosts is not None and len(ghosts.tubes):
            near = float(((ghosts.tubes[:, :3] - lens.view.eye) @ lens.forward).min())
            self._tubes.draw(self.renderer.picture, ghosts.tubes, _DEPTH_BIAS * max(near, 0.05))

    def _draw_growing(self, growing: tuple[ScanPreview, Float] | None) -> None:
        """Draws the running scan; without a scan, frees its GPU memory."""
        if growing is not None:
            self._growing = self._growing or ScanPreviewPass(self.renderer.ctx)
            self._growing.draw(self.renderer.picture, *growing)
        elif self._growing is not None:
            self._growing.release()

    def _draw_puppet(self, over: ToolPicture) -> None:
        """Draws the geometry of the active tool over the image."""
        if over is EMPTY_PICTURE:
            return
        self._puppet_overlay = self._puppet_overlay or PuppetOverlay(self.renderer.ctx)
        picture = self.renderer.picture
        if over.shade is not None:
            self._puppet_overlay.shade(picture, *over.shade)
        if over.self_intersection is not None:
            self._puppet_overlay.crossing(picture, *over.self_intersection)
        if over.ghost is not None:
            self._puppet_overlay.outline(picture, *over.ghost)
        for rows, bias in over.tubes:
            if len(rows):
                self._tubes.draw(picture, rows, bias)
