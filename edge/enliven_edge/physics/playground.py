"""The physics world as the service uses it. One call per frame takes poses and bodies and returns props."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from enliven.arrays import Float
from enliven.deformation.spheres import SphereProxies, pack_spheres
from enliven.document import Character, Props, SkinWeights
from enliven.errors import InputError
from enliven.person import Body
from enliven_edge.physics.games import Dodgeball, Towers
from enliven_edge.physics.ground import FIXED, StandingDetector, WorldGround, body_spheres
from enliven_edge.physics.settings import PhysicsSettings
from enliven_edge.physics.world import World
from enliven_edge.stage.tick import Tick

_MIN_STILL_S = 0.3
"""Seconds for which a performer must stand still before the objects are placed. It is shorter than a step."""
_NEIGHBOURS = 4
"""Maximum number of control points that move a vertex. It is the limit of skin weights."""
_WEIGHT_EXPONENT = 3.0
"""Exponent of the inverse distance weights. It is high, so that the nearest control points dominate."""


def skin_to_control_points(character: Character) -> Character:
    """Returns a puppet with skin weights of its nearest control points.

    Other characters are returned unchanged.
    """
    if character.kind != "points" or len(character.pivots) < 2:
        return character
    neighbour_count = min(_NEIGHBOURS, len(character.pivots) - 1)
    distances, vertices = cKDTree(character.pivots[1:]).query(
        character.vertices, k=np.arange(1, neighbour_count + 1)
    )
    counts = 1.0 / np.maximum(distances, 1e-6) ** _WEIGHT_EXPONENT
    indices = np.zeros((len(character.vertices), 4), np.uint16)
    weights = np.zeros((len(character.vertices), 4), np.float32)
    indices[:, :neighbour_count] = vertices + 1
    weights[:, :neighbour_count] = counts / counts.sum(1, keepdims=True)
    skin = SkinWeights(indices, weights)
    return replace(character, kind="bones", skin=skin, held=None, pulls=None, surface=None)


log = logging.getLogger(__name__)


class Playground:
    """Props, the collision spheres of characters and performers, and a game.

    The world is empty until its place is known: the position at which a performer first stands still, or the
    mean position of one that has moved for long. With the setting "fixed" the place is known immediately. The
    same frames give the same props, unless the time budget skips steps.
    """

    def __init__(self, settings: PhysicsSettings, characters: list[Character] | None = None) -> None:
        if settings.world == "none":
            raise InputError(
                f"the physics world is {settings.world!r}",
                where="physics",
                remedy="Set world to boxes or dodgeball.",
            )
        self.settings = settings
        self.game: Towers | Dodgeball = (
            Towers(settings.boxes)
            if settings.world == "boxes"
            else Dodgeball(settings.dodgeball, settings.engine.gravity)
        )
        self.world = World(self.game.props, settings.engine)
        self.resets = 0
        self._proxies: dict[str, tuple[Character, SphereProxies]] = {}
        self._slots: dict[str, slice] = {}
        self._ground: WorldGround | None = None
        self._standing = self._create_detector()
        self._time_ns: int | None = None
        self._note = ""
        for character in characters or []:
            self.introduce(character)

    def introduce(self, character: Character) -> None:
        """Adds a character, or a new version of one.

        Computes its collision spheres immediately, so that its first motion is not delayed.
        """
        proxies = pack_spheres(skin_to_control_points(character), self.settings.spheres)
        self._proxies[character.id] = character, proxies
        log.info(
            "%s collides as %d spheres with a radius of %.3f m", character.id, len(proxies), proxies.radius
        )

    def show(self, characters: Mapping[str, Character]) -> None:
        """Adds new and changed characters, and removes those that are gone."""
        for name, character in characters.items():
            if name not in self._proxies or self._proxies[name][0] is not character:
                self.introduce(character)
        self._proxies = {name: proxy for name, proxy in self._proxies.items() if name in characters}

    def warm_up(self) -> None:
        """Compiles the code that every frame needs, on a separate world."""
        world = World(self.game.props, self.settings.engine)
        self.game.begin(world, FIXED, np.empty((0, 3)), np.empty(0))
        world.move(world.positions[:1].copy(), np.full(1, 0.05))
        world.advance(0.02)
        for character, proxies in self._proxies.values():
            proxies.centres(character.rest_pose())

    def step(self, tick: Tick) -> Props | None:
        """Returns the props after a frame. Returns None while the place of the world is unknown.

        Poses of characters that were not introduced are ignored.
        """
        bodies, time_ns = tick.bodies, tick.time_ns
        seconds = 0.0 if self._time_ns is None else (time_ns - self._time_ns) * 1e-9
        self._time_ns = time_ns
        if seconds < 0.0:
            # Time runs backwards if a replay starts again. In that case, restart the game, too.
            seconds, self._ground, self._standing = 0.0, None, self._create_detector()
        skipped_before = self._slots
        spheres, radii, names, owners = self._collect_spheres(tick)
        self.world.move(spheres, radii)
        for name in names:
            if skipped_before.get(name) != self._slots[name]:
                self.world.mark_as_new(self._slots[name])
        if self._ground is None:
            self._ground = self._find_place(bodies, time_ns)
            if self._ground is None:
                return None
            self.game.begin(self.world, self._ground, spheres, radii)
        is_late = self.world.left_out
        problem = self.world.advance(seconds)
        if self.world.left_out > is_late == 0.0:
            log.warning(
                "the physics simulation needs more time than engine.budget, so objects sometimes lag behind"
            )
        if problem:
            self._restart_world(problem, spheres, radii)
        self._note = self.game.play(self.world, spheres, names, owners, seconds)
        return self._create_props(time_ns)

    def _create_detector(self) -> StandingDetector:
        return StandingDetector(_MIN_STILL_S, self.settings.patience)

    def _find_place(self, bodies: list[Body], time_ns: int) -> WorldGround | None:
        """Returns the place of the world, or None until it is known."""
        if self.settings.place == "fixed":
            return FIXED
        return self._standing.find(bodies, time_ns)

    def _collect_spheres(self, tick: Tick) -> tuple[Float, Float, list[str], list[int]]:
        """Returns the spheres of all characters and bodies: centres, radii, names, and owners' indices.

        A character or body keeps its slots while it is present. Afterwards others may use the slots.
        """
        spheres_by_name: dict[str, tuple[Float, Float]] = {}
        for pose in tick.poses:
            proxy = self._proxies.get(pose.character)
            if proxy is not None and len(pose.linear) == len(proxy[0].pivots):
                radius = proxy[1].compute_posed_radius(pose)
                spheres_by_name[pose.character] = proxy[1].centres(pose), np.full(len(proxy[1]), radius)
        if self.settings.bodies != "never":
            for body in tick.bodies:
                if self.settings.bodies == "always" or body.id not in tick.holders:
                    spheres_by_name[f"performer {body.id}"] = body_spheres(body)
        self._assign_sphere_slots({name: len(radii) for name, (_, radii) in spheres_by_name.items()})
        count = max((s.stop for s in self._slots.values()), default=0)
        centres, radii = np.full((count, 3), np.nan), np.zeros(count)
        names, owners = list(spheres_by_name), [0] * count
        for number, name in enumerate(names):
            slot = self._slots[name]
            centres[slot], radii[slot] = spheres_by_name[name]
            owners[slot] = [number] * (slot.stop - slot.start)
        return centres, radii, names, owners

    def _assign_sphere_slots(self, counts: dict[str, int]) -> None:
        kept_slots = {n: s for n, s in self._slots.items() if counts.get(n) == s.stop - s.start}
        self._slots = kept_slots
        for name, count in counts.items():
            if name in kept_slots:
                continue
            start = 0
            for slot in sorted(kept_slots.values(), key=lambda s: s.start):
                if slot.start - start >= count:
                    break
                start = max(start, slot.stop)
            kept_slots[name] = slice(start, start + count)

    def _restart_world(self, problem: str, spheres: Float, radii: Float) -> None:
        """Restarts the world after an error of the engine."""
        self.resets += 1
        log.warning("the physics engine failed and was restarted: %s", problem)
        assert self._ground is not None
        self.world.restart()
        self.game.begin(self.world, self._ground, spheres, radii)

    def _create_props(self, time_ns: int) -> Props:
        specs, world = self.game.props, self.world
        return Props(
            time_ns,
            np.arange(len(specs.shapes)),
            specs.shapes,
            specs.sizes.astype(np.float32),
            specs.colours,
            world.positions.copy(),
            world.turns.copy(),
            self._note,
        )
