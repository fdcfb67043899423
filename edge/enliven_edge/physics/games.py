"""The games: towers of boxes to knock over, and dodgeball.

In dodgeball, balls are thrown at the targets in turn.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from enliven.arrays import Float
from enliven.document import BALL, BOX
from enliven.errors import InputError
from enliven_edge.physics.contacts import FLOOR
from enliven_edge.physics.ground import FIXED, WorldGround
from enliven_edge.physics.settings import BoxesSettings, DodgeballSettings
from enliven_edge.physics.world import PropSpecs, World

_BALL_MASS_KG = 0.25
"""Mass in kilograms of a soft ball for children."""
_BALL_RESTITUTION = 0.7
"""Restitution of a rubber ball: speed after a bounce divided by the speed before."""
_RELEASE_HEIGHT_M = 1.3
"""Height in metres at which balls are thrown: the shoulder of an adult."""
_BOX_GAP_M = 0.003
"""Gap in metres between neighbouring boxes. Without it they would rub against each other."""
_STILL_SPEED = 0.05
"""Speed in metres per second below which a box counts as still. The engine's own jitter is slower."""
_FALLEN_DISTANCE = 0.5
"""Distance, in box edge lengths, above which a moved box counts as fallen."""
_MIN_TOWER_GAP_M = 0.15
"""Minimum gap between a new tower and its neighbours, in metres. A performer who possesses a character sways
by less."""
_TOWER_PLACES = np.array(
    [(0.0, 0.0)]
    + [
        (far * np.cos(turn), far * np.sin(turn))
        for far in np.arange(0.1, 4.0, 0.1)
        for turn in np.arange(24) * (2 * np.pi / 24)
    ]
)
"""(A, 2) candidate offsets in metres that move a tower to free space, the nearest first."""
_MAX_BOXES = 200
"""Maximum number of boxes of all towers. With more boxes, the physics is slower than a camera."""
_BLOCK_COLOURS = np.array(
    [(214, 96, 77), (236, 178, 82), (104, 160, 138), (88, 124, 168), (226, 214, 190), (150, 108, 150)]
)
"""(6, 3) sRGB colours of toy blocks, one per layer."""


def tower_props(settings: BoxesSettings) -> PropSpecs:
    """Returns the boxes of all towers, tower by tower, from below.

    Raises:
        InputError: for more boxes than the engine can simulate in time.
    """
    layer = np.repeat(np.arange(settings.high), settings.wide**2)
    count = len(settings.at) * len(layer)
    if count > _MAX_BOXES:
        raise InputError(
            f"the towers have {count} boxes, but at most {_MAX_BOXES} can be simulated in real time",
            where="physics.boxes",
            remedy="Set fewer, lower or narrower towers.",
        )
    # Give neighbours and layers different colours, so that the rotation of a box is visible.
    nth = np.tile(layer + np.arange(len(layer)) % settings.wide, len(settings.at))
    return PropSpecs(
        np.full(count, BOX, np.uint8),
        np.full((count, 3), settings.side / 2),
        np.full(count, settings.mass),
        _BLOCK_COLOURS[nth % len(_BLOCK_COLOURS)].astype(np.uint8),
        np.zeros(count),
    )


def tower_places(settings: BoxesSettings) -> Float:
    """Returns the positions (P, 3) in metres of the boxes of :func:`tower_props`. The axes are sideways, up
    and ahead.
    """
    pitch, half = settings.side + _BOX_GAP_M, (settings.wide - 1) / 2
    places = [
        (x + (i - half) * pitch, (k + 0.5) * settings.side, z + (j - half) * pitch)
        for x, z in settings.at
        for k in range(settings.high)
        for i in range(settings.wide)
        for j in range(settings.wide)
    ]
    return np.array(places).reshape(-1, 3)


def find_clear_places(settings: BoxesSettings, spheres: Float, radii: Float) -> Float:
    """Returns the (P, 3) positions of :func:`tower_places` in metres, with towers moved to free space.

    A tower is moved if a sphere or another tower is in its place.

    A tower goes to the nearest free candidate position. If none is free it stays.

    Args:
        spheres: (S, 3) metres: sideways, up and ahead.
        radii: (S,) metres.
    """
    towers = tower_places(settings).reshape(len(settings.at), settings.high * settings.wide**2, 3)
    half_size, top = (
        (settings.wide * (settings.side + _BOX_GAP_M)) / 2 + _MIN_TOWER_GAP_M,
        settings.high * settings.side + _MIN_TOWER_GAP_M,
    )
    low = spheres[:, 1] - radii < top
    centres, clearances = spheres[low][:, [0, 2]], radii[low] + half_size
    placed_centres = list[Float]()
    for tower in towers:
        places = tower[:, [0, 2]].mean(0) + _TOWER_PLACES
        distances = np.abs(places[:, None] - centres).max(2) > clearances
        is_free = distances.all(1)
        for other in placed_centres:
            is_free &= np.abs(places - other).max(1) > 2 * half_size - _MIN_TOWER_GAP_M
        # If no candidate is free, argmax returns the first one, a zero offset.
        chosen_place = places[int(is_free.argmax())]
        placed_centres.append(chosen_place)
        tower[:, [0, 2]] += chosen_place - tower[:, [0, 2]].mean(0)
    return towers.reshape(-1, 3)


class Towers:
    """The game of :class:`~enliven_edge.physics.playground.Playground` with boxes only."""

    def __init__(self, settings: BoxesSettings) -> None:
        self.settings, self.props = settings, tower_props(settings)
        self._places = tower_places(settings)
        self._stand, self._turns = self._places, np.tile([1.0, 0.0, 0.0, 0.0], (len(self._places), 1))
        self._still_seconds = 0.0

    def begin(self, world: World, ground: WorldGround, spheres: Float, radii: Float) -> None:
        """Resets every box. Each tower stands as near to its configured place as the spheres allow.

        Args:
            spheres: (S, 3) metres in the world. Rows that are not finite are ignored.
            radii: (S,) metres.
        """
        is_finite = np.isfinite(spheres).all(1)
        local_centres = ground.from_world(spheres[is_finite])
        self._stand = ground.to_world(find_clear_places(self.settings, local_centres, radii[is_finite]))
        self._turns = np.tile(ground.turn, (len(self._stand), 1))
        world.set_state(slice(None), self._stand, self._turns)
        self._still_seconds = 0.0

    def play(self, world: World, spheres: Float, names: list[str], owners: list[int], seconds: float) -> str:
        """Rebuilds fallen towers after all boxes have been still for long and their places are free."""
        is_fallen = (
            np.linalg.norm(world.positions - self._stand, axis=1) > _FALLEN_DISTANCE * self.settings.side
        )
        is_still = bool((np.abs(world.velocities[:, :3]) < _STILL_SPEED).all())
        self._still_seconds = self._still_seconds + seconds if is_still and is_fallen.any() else 0.0
        if self.settings.rebuild and self._still_seconds > self.settings.rebuild and self._is_free(spheres):
            world.set_state(slice(None), self._stand, self._turns)
            self._still_seconds = 0.0
        return f"{int(is_fallen.sum())} of {len(is_fallen)} boxes down" if is_fallen.any() else ""

    def _is_free(self, spheres: Float) -> bool:
        """Returns True if no sphere is within a box's edge length of the boxes' initial positions."""
        centres = spheres[np.isfinite(spheres).all(1)]
        if not len(centres):
            return True
        low, high = self._stand.min(0) - 2 * self.settings.side, self._stand.max(0) + 2 * self.settings.side
        near_centres = centres[((centres > low) & (centres < high)).all(1)]
        distances = np.linalg.norm(near_centres[:, None] - self._stand[None], axis=2)
        return bool((distances > 1.5 * self.settings.side).all())


_COLOURS = np.array([(222, 74, 66), (240, 190, 70), (80, 150, 210), (120, 186, 96)])
"""(4, 3) sRGB of the balls, in turn."""
_THROWER_DISTANCE_M = 0.7
"""Distance in metres between the target and a ball that is thrown from another target's place. Otherwise the
ball would start inside the thrower."""
_MIN_THROW_DISTANCE_M = 0.8
"""Minimum distance of a throw in metres. A performer could not react to a ball from a smaller distance."""


class Dodgeball:
    """The dodgeball game: waiting balls are thrown one after the other.

    A ball can score until it touches the floor.

    With two targets or more, a ball comes from the direction of another target; with one, from ahead.

    Args:
        gravity: metres per second squared, downwards.

    Attributes:
        hits: number of hits by target.
    """

    def __init__(self, settings: DodgeballSettings, gravity: float = 9.81) -> None:
        self.settings = settings
        self._gravity = np.array([0.0, -gravity, 0.0])
        count = settings.balls
        self.props = PropSpecs(
            np.full(count, BALL, np.uint8),
            np.full((count, 3), settings.radius),
            np.full(count, _BALL_MASS_KG),
            _COLOURS[np.arange(count) % len(_COLOURS)].astype(np.uint8),
            np.full(count, _BALL_RESTITUTION),
        )
        self.hits: Counter[str] = Counter()
        self._ground: WorldGround = FIXED
        self._target = [""] * count
        self._next, self._turn, self._wait = 0, 0, 0.0

    def begin(self, world: World, ground: WorldGround, spheres: Float, radii: Float) -> None:
        """Puts the balls in a row on the floor at the throwing position. The score does not change."""
        settings = self.settings
        self._ground = ground
        row = (np.arange(settings.balls) - (settings.balls - 1) / 2) * 3 * settings.radius
        places = np.column_stack(np.broadcast_arrays(row, settings.radius, settings.distance))
        world.set_state(slice(None), ground.to_world(places))
        self._target = [""] * settings.balls
        self._wait = 0.0

    def play(self, world: World, spheres: Float, names: list[str], owners: list[int], seconds: float) -> str:
        """Counts hits, and throws the next ball when it is due. Returns the score as text."""
        for ball, touched in enumerate(world.touched):
            if touched >= 0 and self._target[ball]:
                self.hits[names[owners[touched]]] += 1
            if touched >= 0 or touched == FLOOR:
                self._target[ball] = ""
        self._wait += seconds
        present_targets = [
            name
            for name in dict.fromkeys(names)
            if self._target_centre(name, spheres, names, owners) is not None
        ]
        # Do not throw a ball again while it is flying.
        if present_targets and self._wait >= self.settings.every and not self._target[self._next]:
            self._wait = 0.0
            self._throw(world, present_targets, spheres, names, owners)
        adverbs = {1: "once", 2: "twice"}
        return ", ".join(f"{n} hit {adverbs.get(h, f'{h} times')}" for n in names if (h := self.hits[n]))

    def _target_centre(self, name: str, spheres: Float, names: list[str], owners: list[int]) -> Float | None:
        """Returns the centre (3,) of a target's spheres, or None if it has none."""
        target_spheres = spheres[np.array(owners, np.int64) == names.index(name)]
        target_spheres = target_spheres[np.isfinite(target_spheres).all(1)]
        return (
            None
            if not len(target_spheres)
            else np.asarray((target_spheres.min(0) + target_spheres.max(0)) / 2)
        )

    def _throw(
        self, world: World, here: list[str], spheres: Float, names: list[str], owners: list[int]
    ) -> None:
        """Throws the next ball at the centre of the next target."""
        target = here[self._turn % len(here)]
        aim = self._target_centre(target, spheres, names, owners)
        assert aim is not None
        direction, distance = (
            self._ground.to_world(np.array([0.0, 0.0, 1.0])) - self._ground.at,
            self.settings.distance,
        )
        next_centre = self._target_centre(here[(self._turn + 1) % len(here)], spheres, names, owners)
        if len(here) > 1 and next_centre is not None:
            sideways = (next_centre - aim) * [1.0, 0.0, 1.0]
            throw_distance = float(np.linalg.norm(sideways)) - _THROWER_DISTANCE_M
            if throw_distance > _MIN_THROW_DISTANCE_M:
                direction, distance = sideways / np.linalg.norm(sideways), min(distance, throw_distance)
        start = aim + distance * direction
        start[1] = _RELEASE_HEIGHT_M
        flight = self.settings.flight
        speed = (aim - start) / flight - 0.5 * self._gravity * flight
        world.set_state(slice(self._next, self._next + 1), start[None], None, speed[None])
        self._target[self._next] = target
        self._next = (self._next + 1) % self.settings.balls
        self._turn += 1
