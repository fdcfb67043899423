"""Towers of boxes: their places, when they count as fallen, and when they are rebuilt."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import BOX
from enliven.errors import InputError
from enliven_edge.physics.ground import WorldGround
from enliven_edge.physics.settings import BoxesSettings
from enliven_edge.physics.world import PropSpecs, World

_GAP = 0.003
"""Metres between neighbours, which would otherwise rub against each other."""
_STILL = 0.05
"""Metres a second below which a box counts as still: the engine's own trembling is slower."""
_MOVED = 0.5
"""Edges of a box that one must have gone to count as fallen."""
_MOST = 200
"""Boxes of all towers: more do not keep pace with a camera."""
_COLOURS = np.array(
    [(214, 96, 77), (236, 178, 82), (104, 160, 138), (88, 124, 168), (226, 214, 190), (150, 108, 150)]
)
"""sRGB of toy blocks, one a layer."""


def tower_props(settings: BoxesSettings) -> PropSpecs:
    """Returns the boxes of all towers, tower by tower, from below.

    Raises:
        InputError: for more than the engine could follow.
    """
    layer = np.repeat(np.arange(settings.high), settings.wide**2)
    count = len(settings.at) * len(layer)
    if count > _MOST:
        raise InputError(
            f"the towers have {count} boxes, at most {_MOST} keep pace with a camera",
            where="physics.boxes",
            mend="Ask for fewer, lower or narrower towers.",
        )
    # Neighbours and layers differ, so that a turn of a box is seen.
    nth = np.tile(layer + np.arange(len(layer)) % settings.wide, len(settings.at))
    return PropSpecs(
        np.full(count, BOX, np.uint8),
        np.full((count, 3), settings.side / 2),
        np.full(count, settings.mass),
        _COLOURS[nth % len(_COLOURS)].astype(np.uint8),
        np.zeros(count),
    )


def tower_places(settings: BoxesSettings) -> Float:
    """Returns (P, 3) metres, the places of the boxes of :func:`tower_props`: beside, up and ahead."""
    pitch, half = settings.side + _GAP, (settings.wide - 1) / 2
    places = [
        (x + (i - half) * pitch, (k + 0.5) * settings.side, z + (j - half) * pitch)
        for x, z in settings.at
        for k in range(settings.high)
        for i in range(settings.wide)
        for j in range(settings.wide)
    ]
    return np.array(places).reshape(-1, 3)


class Towers:
    """The game of :class:`~enliven_edge.physics.playground.Playground` with nothing but boxes."""

    def __init__(self, settings: BoxesSettings) -> None:
        self.settings, self.props = settings, tower_props(settings)
        self._places = tower_places(settings)
        self._stand, self._turns = self._places, np.tile([1.0, 0.0, 0.0, 0.0], (len(self._places), 1))
        self._quiet = 0.0

    def begin(self, world: World, ground: WorldGround) -> None:
        """Puts every box in its place."""
        self._stand = ground.to_world(self._places)
        self._turns = np.tile(ground.turn, (len(self._stand), 1))
        world.put(slice(None), self._stand, self._turns)
        self._quiet = 0.0

    def play(self, world: World, spheres: Float, names: list[str], owners: list[int], seconds: float) -> str:
        """Rebuilds fallen towers once all boxes have long been still and their places are free."""
        gone = np.linalg.norm(world.positions - self._stand, axis=1) > _MOVED * self.settings.side
        still = bool((np.abs(world.velocities[:, :3]) < _STILL).all())
        self._quiet = self._quiet + seconds if still and gone.any() else 0.0
        if self.settings.rebuild and self._quiet > self.settings.rebuild and self._is_free(spheres):
            world.put(slice(None), self._stand, self._turns)
            self._quiet = 0.0
        return f"{int(gone.sum())} of {len(gone)} boxes down" if gone.any() else ""

    def _is_free(self, spheres: Float) -> bool:
        """Returns whether no sphere is within a box's edge of the boxes' places."""
        known = spheres[np.isfinite(spheres).all(1)]
        if not len(known):
            return True
        low, high = self._stand.min(0) - 2 * self.settings.side, self._stand.max(0) + 2 * self.settings.side
        near = known[((known > low) & (known < high)).all(1)]
        apart = np.linalg.norm(near[:, None] - self._stand[None], axis=2)
        return bool((apart > 1.5 * self.settings.side).all())
