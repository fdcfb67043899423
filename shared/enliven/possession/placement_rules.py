"""Rules for the placement of a mesh, and for the transform of a performer's joints into its rest space. They
implement the modes of the setting ``how``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from enliven.arrays import Float
from enliven.deformation.graph.graph import DeformationGraph
from enliven.document import Character
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.person import Body, J
from enliven.possession.actor_settings import ActorSettings
from enliven.possession.attachment.limb_retargeting import LimbRetargeting
from enliven.possession.attachment.rest_transform import PlacementTransform, RestTransform
from enliven.possession.likeness.finding import find_body_in_mesh, find_person_in_mesh
from enliven.possession.likeness.skeleton import BodyInMesh
from enliven.possession.likeness.standing_person import PERSON_HEIGHT_M, TRUNK_JOINTS
from enliven.possession.placement import AS_MODELLED, Placement, placement_under_hips, shift_left

_MAX_ORIGIN_DISTANCE_M = 0.2
"""Maximum distance (metres) of a mesh's floor area from its origin if a performer stands at the origin. It is
half the width of a person of average height."""


def needs_person_search(settings: ActorSettings) -> bool:
    """Returns True if the settings require a search for a person in the mesh. The search is needed if the
    performer is inside the mesh and a human-like mesh moves limb by limb.
    """
    meets = settings.meets and settings.how == "inside" and settings.follow == "skeleton"
    return meets and settings.place == "meet" and settings.scaled == "mesh"


class PlacementRules:
    """Rules that place a mesh, and that transform performers into its rest space, according to the settings.

    Args:
        height: height of the rest mesh, metres.
        size: metres of the mesh as modelled per metre of its rest space.
        person: a function that waits for the background search for a person, and returns the person or None.
            If it is not given, the search runs when the result is needed.
    """

    def __init__(
        self,
        settings: ActorSettings,
        character: Character,
        graph: DeformationGraph,
        height: float,
        size: float,
        person: Callable[[], BodyInMesh | None] | None = None,
    ) -> None:
        self.settings, self.height, self.size = settings, height, size
        self._person = person
        self._character, self._graph = character, graph

    @cached_property
    def likeness(self) -> BodyInMesh | None:
        """The person-like skeleton in the mesh if the mesh is driven limb by limb. None if the performer's
        bones attach to nearby nodes instead.
        """
        settings, ends = self.settings, np.array(self.settings.ends, np.float64)
        if settings.how != "mapped" and not needs_person_search(settings):
            return None
        if settings.joints:
            return BodyInMesh.from_joints(_joint_array(settings.joints, self._character.id))
        mesh = Mesh(self._character.vertices.astype(np.float64), self._character.faces, self._character.id)
        if settings.how == "mapped":
            return find_body_in_mesh(mesh, self._graph, ends)
        person = find_person_in_mesh(mesh, ends) if self._person is None else self._person()
        return person if person is not None and (person.is_certain or settings.ends) else None

    @cached_property
    def stand(self) -> Float:
        """(3,) metres of the rest space: the point on the floor at which a performer stands in the mesh.

        It is the origin, or the middle of the mesh if the mesh is far from the origin. A mesh may be far from
        the origin of its project, for example a scan next to another character.
        """
        corners = self._character.vertices[:, [0, 2]]
        low, high = corners.min(0).astype(np.float64), corners.max(0).astype(np.float64)
        distance = np.maximum(np.maximum(low, -high), 0.0)
        if np.linalg.norm(distance) <= self._max_mesh_distance():
            return np.zeros(3)
        middle = 0.5 * (low + high)
        if self.likeness is not None:
            middle = self.likeness.joints[TRUNK_JOINTS][:, [0, 2]].mean(0)
        return np.array([middle[0], 0.0, middle[1]])

    def _max_mesh_distance(self) -> float:
        """Returns the maximum distance between mesh and origin, in the rest space, at which a performer
        stands at the origin.
        """
        settings = self.settings
        metres = settings.farthest_reach if settings.stand == "modelled" else _MAX_ORIGIN_DISTANCE_M
        scale = settings.height_ratio * PERSON_HEIGHT_M / self.height
        return metres / (self.size if settings.scaled == "nobody" else scale)

    def compute_waiting_placement(self, body: Body, farther: float = 0.0) -> Placement:
        """Returns the placement of a mesh that waits for its first performer, moved to the left by an
        additional ``farther`` metres.
        """
        placement = self.placement_at(body)
        metres = farther + (0.0 if self.settings.how == "inside" else self.settings.aside)
        return shift_left(placement, metres) if metres else placement

    def placement_at(self, body: Body) -> Placement:
        """Returns the placement at the performer's position, with the mesh's front in the performer's
        heading.
        """
        scales_mesh = self.settings.scaled == "mesh"
        front = 0.0 if self.likeness is None else self.likeness.yaw
        return placement_under_hips(
            body, self._performer_scale(body) if scales_mesh else self.size, self.stand, front
        )

    def compute_rest_transforms(
        self,
        body: Body,
        placement: Placement,
        earlier: list[RestTransform],
        own_earlier: RestTransform | None = None,
    ) -> list[RestTransform]:
        """Returns the transforms with which a body may attach, the best first.

        Args:
            placement: the current placement of the mesh.
            earlier: the transforms of the attachments that are kept, of other bodies and of this body.
            own_earlier: the transform of the body's current attachment, even if it is not kept. If the mesh
                stands next to the performer, the new attachment continues with this transform. So attaching
                again causes no motion.
        """
        settings, scale = self.settings, self._performer_scale(body)
        inside = settings.how == "inside"
        if not inside and isinstance(own_earlier, LimbRetargeting):
            return [own_earlier]
        if self.likeness is not None and not (inside and earlier):
            front = self._mesh_heading(self.placement_at(body) if inside else placement)
            retargeting = LimbRetargeting(
                self.likeness, body, scale, settings.travel, settings.fade, settings.fade_pace, inside, front
            )
            if isinstance(own_earlier, LimbRetargeting):
                retargeting.continue_from(own_earlier)
            return [retargeting]
        mapped = next((transform for transform in earlier if isinstance(transform, LimbRetargeting)), None)
        if mapped is not None and mapped.body == body.id:
            return [mapped]
        placements = [
            transform.placement for transform in earlier[:1] if isinstance(transform, PlacementTransform)
        ]
        if inside and mapped is not None:
            placements = [placement]
        elif inside and settings.place == "fixed" and not placements:
            fixed = scale if settings.scaled == "performer" else AS_MODELLED.scale
            placements = [Placement(fixed, placement.yaw, placement.offset)]
        elif not inside or not placements:
            placements.append(placement_under_hips(body, scale, self.stand))
        return [PlacementTransform(candidate, settings.travel, not inside) for candidate in placements]

    def _mesh_heading(self, placement: Placement) -> float:
        """Returns the heading of the mesh at rest in the world, radians about +Y."""
        return placement.yaw + (0.0 if self.likeness is None else self.likeness.yaw)

    def approach_transform(self, body: Body, placement: Placement) -> LimbRetargeting | None:
        """Returns the transform that moves a waiting mesh into a performer's pose. None means that the mesh
        keeps its own pose.

        Args:
            placement: the placement of the waiting mesh.
        """
        settings, likeness = self.settings, self.likeness
        if not settings.ahead or likeness is None or not likeness.human:
            return None
        scale, front = self._performer_scale(body), self._mesh_heading(placement)
        return LimbRetargeting(likeness, body, scale, 0.0, settings.fade, settings.fade_pace, front=front)

    def _performer_scale(self, body: Body) -> float:
        """Returns the scale from the rest space to the performer."""
        if self.settings.scaled == "nobody":
            return self.size
        return self.settings.height_ratio * body.height / self.height


def _joint_array(joints: tuple[tuple[float, float, float], ...], character: str) -> Float:
    """Returns joints as (20, 3) metres.

    Raises:
        InputError: if their number is not 20.
    """
    if len(joints) != J:
        advice = f"Set all {J} joints in their fixed order, or none."
        raise InputError(
            f"the number of joints is {len(joints)}, expected {J}", where=character, remedy=advice
        )
    return np.array(joints, np.float64)
