"""Soft constraints on a mesh in addition to the attached bones: observed surface, floor, and self-contact."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from enliven.arrays import Float
from enliven.deformation.constraints.floor_contact import FloorContact
from enliven.deformation.constraints.observed import ObservedPoints, ObservedSurface
from enliven.deformation.constraints.planes import PlaneConstraints
from enliven.deformation.constraints.self_contact import SelfContact
from enliven.deformation.constraints.soft import join_planes
from enliven.deformation.graph.graph import DeformationGraph
from enliven.document import Character
from enliven.possession.actor_settings import ActorSettings
from enliven.possession.attachment.performer_attachment import PerformerAttachment


class SoftConstraints:
    """The soft constraints that the settings enable. Disabled constraints take no computing time."""

    def __init__(self, character: Character, graph: DeformationGraph, settings: ActorSettings) -> None:
        follows = settings.follow != "skeleton"
        self._surface = ObservedSurface(character, settings.observed) if follows else None
        self._limbs = SelfContact(character, graph, settings.limbs) if settings.limbs.use else None
        self._floor = FloorContact(character, settings.floor) if settings.floor.use != "off" else None
        self._raises = settings.floor.use == "raised"

    def planes(
        self,
        state: tuple[Float, Float],
        holds: Iterable[PerformerAttachment],
        seen: Mapping[int, ObservedPoints],
        floor: float,
        seconds: float,
    ) -> PlaneConstraints | None:
        """Returns the plane constraints of the frame, or None if there are none.

        Args:
            state: current (N, 3, 3) linear parts and (N, 3) positions.
            holds: the attachments of all performers to the mesh.
            seen: for each body id, the visible part of the performer's surface.
            floor: height of the floor in the rest space, metres.
            seconds: time since the last frame.
        """
        sets = []
        if self._surface is not None:
            for hold in holds:
                surface = seen.get(hold.body) if hold.active else None
                if surface is not None:
                    points, normals = hold.rest_transform.surface(surface.points, surface.normals)
                    metre = 1.0 / hold.rest_transform.scale
                    sets.append(self._surface.planes(*state, points, normals, metre))
        if self._limbs is not None:
            sets.append(self._limbs.planes(*state))
        if self._floor is not None and not self._raises:
            above = self._floor.planes(*state, seconds, floor)
            sets += [above] if above is not None else []
        return join_planes(sets)

    def lift_out_of_floor(self, linear: Float, positions: Float, floor: float) -> tuple[Float, Float]:
        """Lifts a mesh that is below the floor if the settings require it. ``floor`` is the floor height in
        the rest space, metres.
        """
        if self._floor is not None and self._raises:
            positions = self._floor.raise_above_floor(linear, positions, floor)
        return linear, positions

    def reset_contacts(self) -> None:
        """Resets the foot contacts. Call it when the mesh is placed elsewhere."""
        if self._floor is not None:
            self._floor.reset()
