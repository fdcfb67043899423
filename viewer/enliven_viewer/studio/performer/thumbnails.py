"""Small pictures of key poses: solved beside the window, drawn one a frame by the viewer's renderer, kept."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor

import moderngl
import numpy as np

from enliven.arrays import Float
from enliven.deformation.arap import PuppetSurface
from enliven.document import Puppet
from enliven.meshes import Mesh
from enliven_viewer.render import PLAIN, OrbitCamera, Renderer, Scene, SceneCharacter
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.puppets import puppet_meshes

log = logging.getLogger(__name__)
_SIZE = (176, 160)
"""Pixels, width and height of a thumbnail: twice those of a tile, for screens with small pixels."""
_SETTINGS = RenderSettings(shadow_size=256, contact_size=64, samples=4)
SIDE = 0.42
"""Radians from the front that thumbnails and their stick figures are seen from: both arms show."""
_ABOVE = 0.16
"""Radians above the horizon that a thumbnail is seen from: a little, so that feet part."""
_ROOM = 1.06
"""Size of a thumbnail over that of the puppet: little room, since it is small."""
_KEPT = 96
"""Pictures that are kept, of 110 kB each: several strips of key poses."""

_Key = tuple[object, ...]


class Thumbnails:
    """Pictures of puppets in poses, as textures.

    Args:
        ctx: an OpenGL context that is current in this thread.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._renderer: Renderer | None = None
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="thumbnails")
        self._solver, self._characters = _Solver(), puppet_meshes()
        self._solving: dict[_Key, tuple[Puppet, Future[Float]]] = {}
        self._done: dict[_Key, tuple[Mesh, moderngl.Texture]] = {}
        self._shown: dict[tuple[str, int], _Key] = {}

    def texture(self, puppet: Puppet, places: Float, slot: int = 0) -> int | None:
        """The OpenGL name of the picture, upper row first; None until it is drawn.

        Args:
            slot: the number of the picture; until it is drawn, the last picture of the slot is shown.
        """
        key = _key(puppet, places)
        known = self._done.get(key)
        if known is not None:
            self._done[key] = self._done.pop(key)
            self._shown[(puppet.id, slot)] = key
            return int(known[1].glo)
        if key not in self._solving:
            self._solving[key] = puppet, self._pool.submit(self._solver.surface, puppet, places)
        before = self._done.get(self._shown.get((puppet.id, slot), ()))
        return int(before[1].glo) if before is not None and before[0] is puppet.mesh else None

    def work(self) -> None:
        """Draw one that is solved; to be called once a picture."""
        for key, (puppet, future) in list(self._solving.items()):
            if not future.done():
                continue
            del self._solving[key]
            if future.exception() is not None:
                log.warning("a key pose cannot be drawn", exc_info=future.exception())
                continue
            self._done[key] = puppet.mesh, self._drawn(puppet, future.result())
            while len(self._done) > _KEPT:
                self._done.pop(next(iter(self._done)))[1].release()
            return

    def _drawn(self, puppet: Puppet, vertices: Float) -> moderngl.Texture:
        if self._renderer is None:
            self._renderer = Renderer(self._ctx, _SIZE, _SETTINGS)
        character = self._characters.of(puppet)
        assert character is not None
        low = np.minimum(puppet.mesh.vertices.min(0), vertices.min(0))
        high = np.maximum(puppet.mesh.vertices.max(0), vertices.max(0))
        camera, aspect = OrbitCamera(0.5), _SIZE[0] / _SIZE[1]
        camera.face(SIDE, _ABOVE)
        camera.frame((low, high), aspect, at_once=True, room=_ROOM)
        camera.advance(10.0)
        actor = SceneCharacter(character, character.rest_pose(), vertices=vertices.astype(np.float32))
        self._renderer.draw(Scene((actor,), (), PLAIN, extent=(low, high)), camera.view(aspect))
        return self._ctx.texture(_SIZE, 3, self._renderer.pixels().tobytes(), alignment=1)


class _Solver:
    """One surface, built anew for another mesh or other control points; in a thread of its own."""

    def __init__(self) -> None:
        self._for: tuple[object, ...] = ()
        self._surface: PuppetSurface | None = None

    def surface(self, puppet: Puppet, places: Float) -> Float:
        """(V, 3) metres in the mesh's frame."""
        held = tuple((point.vertex, point.weight) for point in puppet.points)
        wanted = (id(puppet.mesh), held, puppet.surface)
        if self._surface is None or self._for != wanted:
            vertices, weights = [vertex for vertex, _ in held], [weight for _, weight in held]
            self._surface = PuppetSurface(puppet.mesh, vertices, weights, puppet.surface)
            self._for = wanted
        return np.array(self._surface.settle(places))


def _key(puppet: Puppet, places: Float) -> _Key:
    held: Iterable[object] = ((point.vertex, point.weight) for point in puppet.points)
    return id(puppet.mesh), puppet.id, tuple(held), puppet.surface, np.asarray(places).tobytes()
