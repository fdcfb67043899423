"""Where a mesh stands, and how a performer comes to it: in it, beside it, at whose size."""

from __future__ import annotations

from enliven.deformation.graph import DeformationGraph
from enliven.deformation.possession import find_body_in_mesh
from enliven.person import Body
from enliven_edge.stage.actor_settings import ActorSettings
from enliven_edge.stage.carrying import Carrying, Mapped, Placed
from enliven_edge.stage.placement import AS_MODELLED, Placement, beside, under


class Whereabouts:
    """Places a mesh and its performers by the settings.

    Args:
        height: metres of the rest mesh.
        size: metres of the mesh as modelled for one of its rest space.
    """

    def __init__(self, settings: ActorSettings, graph: DeformationGraph, height: float, size: float) -> None:
        self.settings, self.height, self.size = settings, height, size
        self._likeness = find_body_in_mesh(graph) if settings.how == "mapped" else None

    def waits(self, body: Body) -> Placement:
        """Where the mesh waits for whom it sees first."""
        stands = self.stands(body)
        return stands if self.settings.how == "inside" else beside(stands, self.settings.aside)

    def stands(self, body: Body) -> Placement:
        """The mesh where the performer stands, its front where they face."""
        alike = self.settings.scaled == "mesh"
        place = under(body, self._performer_scale(body) if alike else self.size)
        front = 0.0 if self._likeness is None else self._likeness.yaw
        return Placement(place.scale, place.yaw - front, place.offset)

    def ways(self, body: Body, placement: Placement, taken: list[Carrying]) -> list[Carrying]:
        """How a body may come to the mesh, the best first.

        Args:
            placement: where the mesh stands.
            taken: how others came, or the body itself before.
        """
        if self._likeness is not None:
            scale = self._performer_scale(body)
            return [Mapped(self._likeness, body, scale, self.settings.travel)]
        inside = self.settings.how == "inside"
        ways = [way.placement for way in taken[:1] if isinstance(way, Placed)]
        if inside and self.settings.place == "fixed" and not ways:
            scale = self._performer_scale(body) if self.settings.scaled == "performer" else AS_MODELLED.scale
            ways = [Placement(scale, placement.yaw, placement.offset)]
        elif not inside or not ways:
            ways.append(under(body, self._performer_scale(body)))
        return [Placed(way, self.settings.travel, not inside) for way in ways]

    def _performer_scale(self, body: Body) -> float:
        """Metres of the performer for one of the rest space."""
        if self.settings.scaled == "nobody":
            return self.size
        return self.settings.height_ratio * body.height / self.height
