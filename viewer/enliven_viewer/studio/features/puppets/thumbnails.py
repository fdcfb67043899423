"""Thumbnails of key poses: solved in the background, rendered one per frame, and cached."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from concurrent.futures import Future

import moderngl
import numpy as np

from enliven.arrays import Float
from enliven.document import ExampleCharacter
from enliven.meshes import Mesh
from enliven_viewer.render.camera import OrbitCamera
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import PLAIN, Scene, SceneCharacter
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.puppets.puppet_stage import create_puppet_meshes
from enliven_viewer.studio.puppets.surfaces import PuppetSurfaces
from enliven_viewer.theme import get_theme, look_in_theme

log = logging.getLogger(__name__)
_SIZE = (176, 160)
"""Width and height of a thumbnail in pixels: twice the size of a tile, for high-resolution screens."""
_SETTINGS = RenderSettings(shadow_size=256, contact_size=64, samples=4)
SIDE = 0.42
"""Azimuth in radians from the front for thumbnails and their stick figures. Both arms are visible from it."""
_ELEVATION = 0.16
"""Elevation of the thumbnails' camera in radians. It is slightly above the horizon, so that the feet do not
overlap.
"""
_FRAMING_MARGIN = 1.06
"""Size of the view relative to the puppet. The margin is small, because thumbnails are small."""
_MAX_CACHED_THUMBNAILS = 96
"""Maximum number of cached thumbnails, of 110 kB each: several strips of key poses."""

_Key = tuple[object, ...]


class Thumbnails:
    """Thumbnails of posed puppets, as textures.

    Args:
        ctx: an OpenGL context that is current in this thread.
        surfaces: solves the surfaces in the background.
    """

    def __init__(self, ctx: moderngl.Context, surfaces: PuppetSurfaces) -> None:
        self._ctx, self._surfaces = ctx, surfaces
        self._renderer: Renderer | None = None
        self._characters = create_puppet_meshes()
        self._solving: dict[_Key, tuple[ExampleCharacter, Future[Float]]] = {}
        self._textures: dict[_Key, tuple[Mesh, moderngl.Texture]] = {}
        self._shown_keys: dict[tuple[str, int], _Key] = {}

    def texture(self, puppet: ExampleCharacter, places: Float, slot: int = 0) -> int | None:
        """Returns the OpenGL name of the thumbnail's texture, top row first, or None until it is drawn.

        Args:
            slot: number of the widget that shows the thumbnail. Until the thumbnail is drawn, the slot's
                previous thumbnail is returned.
        """
        key = (*_make_key(puppet, places), get_theme())
        thumbnail = self._textures.get(key)
        if thumbnail is not None:
            self._textures[key] = self._textures.pop(key)
            self._shown_keys[(puppet.id, slot)] = key
            return int(thumbnail[1].glo)
        future = (
            self._solving[key][1]
            if key in self._solving
            else self._surfaces.solve_in_background(puppet, places)
        )
        if future is not None:
            self._solving[key] = puppet, future
        old_texture = self._textures.get(self._shown_keys.get((puppet.id, slot), ()))
        return int(old_texture[1].glo) if old_texture is not None and old_texture[0] is puppet.mesh else None

    def draw_next(self) -> None:
        """Draws one solved thumbnail. Call once per frame."""
        for key, (puppet, future) in list(self._solving.items()):
            if not future.done():
                continue
            del self._solving[key]
            if future.exception() is not None:
                log.warning("the thumbnail of a key pose cannot be drawn", exc_info=future.exception())
                continue
            self._textures[key] = puppet.mesh, self._draw_thumbnail(puppet, future.result())
            while len(self._textures) > _MAX_CACHED_THUMBNAILS:
                self._textures.pop(next(iter(self._textures)))[1].release()
            return

    def _draw_thumbnail(self, puppet: ExampleCharacter, vertices: Float) -> moderngl.Texture:
        if self._renderer is None:
            self._renderer = Renderer(self._ctx, _SIZE, _SETTINGS)
        character = self._characters.get_mesh(puppet)
        assert character is not None
        low = np.minimum(puppet.mesh.vertices.min(0), vertices.min(0))
        high = np.maximum(puppet.mesh.vertices.max(0), vertices.max(0))
        camera, aspect = OrbitCamera(0.5), _SIZE[0] / _SIZE[1]
        camera.face(SIDE, _ELEVATION)
        camera.frame((low, high), aspect, at_once=True, margin=_FRAMING_MARGIN)
        camera.advance(10.0)
        actor = SceneCharacter(character, character.rest_pose(), vertices=vertices.astype(np.float32))
        self._renderer.look = look_in_theme("studio")
        self._renderer.draw(Scene((actor,), (), PLAIN, extent=(low, high)), camera.view(aspect))
        return self._ctx.texture(_SIZE, 3, self._renderer.pixels().tobytes(), alignment=1)


def _make_key(puppet: ExampleCharacter, places: Float) -> _Key:
    held: Iterable[object] = ((point.vertex, point.weight) for point in puppet.points)
    return id(puppet.mesh), puppet.id, tuple(held), puppet.surface, np.asarray(places).tobytes()
