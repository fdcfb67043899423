"""Dodgeball: balls are thrown at every target in turn; a hit by a ball in flight counts."""

from __future__ import annotations

from collections import Counter

import numpy as np

from enliven.arrays import Float
from enliven.document import BALL
from enliven_edge.physics.contacts import FLOOR
from enliven_edge.physics.ground import FIXED, WorldGround
from enliven_edge.physics.settings import DodgeballSettings
from enliven_edge.physics.world import PropSpecs, World

_COLOURS = np.array([(222, 74, 66), (240, 190, 70), (80, 150, 210), (120, 186, 96)])
"""(4, 3) sRGB of the balls, in turn."""
_ROOM = 0.7
"""Metres between the target that a ball comes from and the ball, so that it does not start inside."""
_NEAREST = 0.8
"""Metres of the shortest throw: a nearer one could not be seen coming."""


class Dodgeball:
    """The game: balls lie ready, one after the other is thrown, each counts until it touches the floor.

    With two targets or more a ball comes from the side of another one; with one, from ahead.

    Args:
        gravity: metres a second squared, downwards.

    Attributes:
        hits: by target, how often it was hit.
    """

    def __init__(self, settings: DodgeballSettings, gravity: float = 9.81) -> None:
        self.settings = settings
        self._gravity = np.array([0.0, -gravity, 0.0])
        count = settings.balls
        self.props = PropSpecs(
            np.full(count, BALL, np.uint8),
            np.full((count, 3), settings.radius),
            np.full(count, settings.mass),
            _COLOURS[np.arange(count) % len(_COLOURS)].astype(np.uint8),
            np.full(count, settings.bounce),
        )
        self.hits: Counter[str] = Counter()
        self._ground: WorldGround = FIXED
        self._target = [""] * count
        self._next, self._turn, self._wait = 0, 0, 0.0

    def begin(self, world: World, ground: WorldGround) -> None:
        """Puts the balls in a row on the floor, beside the place that they are thrown from; the score is
        kept."""
        settings = self.settings
        self._ground = ground
        row = (np.arange(settings.balls) - (settings.balls - 1) / 2) * 3 * settings.radius
        places = np.column_stack(np.broadcast_arrays(row, settings.radius, settings.distance))
        world.put(slice(None), ground.to_world(places))
        self._target = [""] * settings.balls
        self._wait = 0.0

    def play(self, world: World, spheres: Float, names: list[str], owners: list[int], seconds: float) -> str:
        """Counts hits, and throws the next ball when it is due; returns the score."""
        for ball, touched in enumerate(world.touched):
            if touched >= 0 and self._target[ball]:
                self.hits[names[owners[touched]]] += 1
            if touched >= 0 or touched == FLOOR:
                self._target[ball] = ""
        self._wait += seconds
        here = [
            name for name in dict.fromkeys(names) if self._middle(name, spheres, names, owners) is not None
        ]
        # A ball in flight is not taken out of the air.
        if here and self._wait >= self.settings.every and not self._target[self._next]:
            self._wait = 0.0
            self._throw(world, here, spheres, names, owners)
        told = {1: "once", 2: "twice"}
        return ", ".join(f"{n} hit {told.get(h, f'{h} times')}" for n in names if (h := self.hits[n]))

    def _middle(self, name: str, spheres: Float, names: list[str], owners: list[int]) -> Float | None:
        """Returns (3,) the middle of a target's spheres, None where it has none."""
        own = spheres[np.array(owners, np.int64) == names.index(name)]
        own = own[np.isfinite(own).all(1)]
        return None if not len(own) else np.asarray((own.min(0) + own.max(0)) / 2)

    def _throw(
        self, world: World, here: list[str], spheres: Float, names: list[str], owners: list[int]
    ) -> None:
        """Throws the next ball at the next target, so that it arrives at its middle."""
        target = here[self._turn % len(here)]
        aim = self._middle(target, spheres, names, owners)
        assert aim is not None
        way, far = self._ground.to_world(np.array([0.0, 0.0, 1.0])) - self._ground.at, self.settings.distance
        other = self._middle(here[(self._turn + 1) % len(here)], spheres, names, owners)
        if len(here) > 1 and other is not None:
            across = (other - aim) * [1.0, 0.0, 1.0]
            room = float(np.linalg.norm(across)) - _ROOM
            if room > _NEAREST:
                way, far = across / np.linalg.norm(across), min(far, room)
        begin = aim + far * way
        begin[1] = self.settings.hand
        flight = self.settings.flight
        speed = (aim - begin) / flight - 0.5 * self._gravity * flight
        world.put(slice(self._next, self._next + 1), begin[None], None, speed[None])
        self._target[self._next] = target
        self._next = (self._next + 1) % self.settings.balls
        self._turn += 1
