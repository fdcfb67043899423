"""The 3-D picture of the studio: shapes by the viewer's renderer, skeletons over them."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from enliven.document import Character, Shape, character_of
from enliven_viewer.playback import bounds_of
from enliven_viewer.render import PLAIN, Renderer, Scene, SceneCharacter
from enliven_viewer.render.overlay import Tubes
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.picture.skeletons import skeleton_rows
from enliven_viewer.studio.puppets import PuppetCharacters, PuppetOverlay, StandingPuppet
from enliven_viewer.studio.tools import NOTHING, PuppetPicture
from enliven_viewer.studio.viewport import (
    Characters,
    Lens,
    Overlay,
    PosedShape,
    Possessed,
    Selection,
    coloured,
)

_SEEN_THROUGH = 0.4
"""Of the eye's distance: bones are seen clearly through whatever covers them by less."""


class Viewport:
    """Draws posed shapes into a picture of its own; :attr:`renderer` holds it.

    Args:
        ctx: an OpenGL context that is current in this thread.
        size: width and height of the picture in pixels.
    """

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int], settings: RenderSettings) -> None:
        self.renderer = Renderer(ctx, size, settings)
        self._tubes = Tubes(ctx)
        self._graphs = Characters()
        self._puppets = PuppetCharacters()
        self._puppet_overlay: PuppetOverlay | None = None
        self._characters: dict[str, tuple[tuple[object, ...], Character]] = {}

    def draw(
        self,
        posed_shapes: Sequence[PosedShape],
        lens: Lens,
        selection: Selection,
        overlay: Overlay,
        *,
        possessed: Sequence[Possessed] = (),
        puppets: Sequence[StandingPuppet] = (),
        over: PuppetPicture = NOTHING,
        meshes: bool = True,
        bones: bool = True,
    ) -> None:
        """One picture, resolved."""
        solid = (
            [s for s in posed_shapes if s.shape.mesh is not None and len(s.shape.mesh.faces)]
            if meshes
            else []
        )
        actors = tuple(SceneCharacter(self._character(s.shape), s.pose()) for s in solid)
        kept = {actor.character.id for actor in actors}
        self._characters = {name: known for name, known in self._characters.items() if name in kept}
        actors += tuple(SceneCharacter(self._graphs.of(mesh.shape), mesh.pose) for mesh in possessed)
        actors += tuple(SceneCharacter(self._puppets.of(p.puppet), p.pose, vertices=p.drawn) for p in puppets)
        filled = [s.joints for s in posed_shapes] + [mesh.vertices for mesh in possessed]
        extent = bounds_of(filled + [puppet.drawn for puppet in puppets])
        self.renderer.draw(Scene(actors, (), PLAIN, extent=extent), lens.view)
        self._draw_puppet(over)
        if bones and posed_shapes:
            rows = np.concatenate([skeleton_rows(s, lens, selection, overlay) for s in posed_shapes])
            near = min(float(((s.joints - lens.view.eye) @ lens.forward).min()) for s in posed_shapes)
            self._tubes.draw(self.renderer.picture, rows, _SEEN_THROUGH * max(near, 0.05))

    def _draw_puppet(self, over: PuppetPicture) -> None:
        """Draw what the puppet tool shows over the picture."""
        if over is NOTHING:
            return
        self._puppet_overlay = self._puppet_overlay or PuppetOverlay(self.renderer.ctx)
        picture = self.renderer.picture
        if over.crossing is not None:
            self._puppet_overlay.crossing(picture, *over.crossing)
        if over.ghost is not None:
            self._puppet_overlay.outline(picture, *over.ghost)
        for rows, bias in over.tubes:
            if len(rows):
                self._tubes.draw(picture, rows, bias)

    def _character(self, shape: Shape) -> Character:
        """The shape's character, the same object while its surface, skin and rest are the same."""
        parts = (shape.mesh, shape.skin, shape.skeleton)
        known = self._characters.get(shape.id)
        if known is None or any(a is not b for a, b in zip(known[0], parts, strict=True)):
            known = (parts, coloured(character_of(shape)))
            self._characters[shape.id] = known
        return known[1]
