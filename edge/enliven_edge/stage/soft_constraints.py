"""What draws and pushes a mesh besides its performers' bones: what is seen, the floor, its own limbs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from enliven.arrays import Float
from enliven.deformation.constraints import (
    FloorContact,
    ObservedPoints,
    ObservedSurface,
    PlaneConstraints,
    SelfContact,
    joined_planes,
)
from enliven.deformation.graph import DeformationGraph
from enliven.document import Character
from enliven_edge.stage.actor_settings import ActorSettings
from enliven_edge.stage.hold import Hold


class SoftTerms:
    """The soft terms that the settings ask for; none of them costs anything where it is off."""

    def __init__(self, character: Character, graph: DeformationGraph, settings: ActorSettings) -> None:
        follows = settings.follow != "skeleton"
        self._surface = ObservedSurface(character, settings.observed) if follows else None
        self._limbs = SelfContact(character, graph, settings.limbs) if settings.limbs.use else None
        self._floor = FloorContact(character, settings.floor) if settings.floor.use != "off" else None
        self._raises = settings.floor.use == "raised"

    def planes(
        self,
        state: tuple[Float, Float],
        holds: Iterable[Hold],
        seen: Mapping[int, ObservedPoints],
        floor: float,
        seconds: float,
    ) -> PlaneConstraints | None:
        """The frame's planes, None where there are none.

        Args:
            state: (N, 3, 3) linear parts and (N, 3) positions, as they are.
            holds: everybody who holds the mesh.
            seen: what the sensor sees of each performer.
            floor: metres, the floor's height in the rest space.
            seconds: since the last frame.
        """
        sets = []
        if self._surface is not None:
            for hold in holds:
                surface = seen.get(hold.body) if hold.active else None
                if surface is not None:
                    points, normals = hold.carrying.surface(surface.points, surface.normals)
                    metre = 1.0 / hold.carrying.scale
                    sets.append(self._surface.planes(*state, points, normals, metre))
        if self._limbs is not None:
            sets.append(self._limbs.planes(*state))
        if self._floor is not None and not self._raises:
            above = self._floor.planes(*state, seconds, floor)
            sets += [above] if above is not None else []
        return joined_planes(sets)

    def raised(self, linear: Float, positions: Float, floor: float) -> tuple[Float, Float]:
        """The state, lifted out of the floor where the settings ask for it; ``floor`` in the rest space."""
        if self._floor is not None and self._raises:
            positions = self._floor.raised(linear, positions, floor)
        return linear, positions

    def moved_elsewhere(self) -> None:
        """The mesh was put elsewhere: no foot stands where it did."""
        if self._floor is not None:
            self._floor.reset()
