"""Rules for the placement of a mesh and the transform of joints into it: inside, beside or mapped."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from enliven.arrays import Float
from enliven.deformation.graph import DeformationGraph
from enliven.document import Character
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.person import Body, J, Joint
from enliven.possession.actor_settings import ActorSettings
from enliven.possession.likeness import BodyInMesh, find_body_in_mesh, find_person_in_mesh
from enliven.possession.limb_retargeting import LimbRetargeting
from enliven.possession.placement import AS_MODELLED, Placement, placement_under_hips, shift_left
from enliven.possession.rest_transform import PlacementTransform, RestTransform

_MAX_ORIGIN_DISTANCE_M = 0.2
"""Maximum distance, metres, from the floor area of a mesh to its origin for a performer to stand at the
origin. Half a person's width."""
_USUAL_HEIGHT_M = 1.75
"""Performer height, metres, that ``_MAX_ORIGIN_DISTANCE_M`` assumes, because a mesh is scaled to its
performer's height."""
_TRUNK_JOINTS = (Joint.HIP_LEFT, Joint.HIP_RIGHT, Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT)
"""Joints around the middle of a person's trunk."""


def needs_person_search(settings: ActorSettings) -> bool:
    """Returns True if a person is searched in the mesh, because a human-like mesh around its performer moves
    limb by limb."""
    meets = settings.meets and settings.how == "inside" and settings.follow == "skeleton"
    return meets and settings.place == "meet" and settings.scaled == "mesh"


class PlacementRules:
    """Rules that place a mesh, and that transform performers into its rest space, according to the settings.

    Args:
        height: metres of the rest mesh.
        size: metres of the mesh as modelled per metre of its rest space.
        person: waits for the result (a person or None) of the search in the mesh, which runs in the
            background. If not given, the search runs here.
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
        """A person's skeleton in the mesh, if limb drives limb; None if bones hold the nodes near them."""
        settings, ends = self.settings, np.array(self.settings.ends, np.float64)
        if settings.how != "mapped" and not needs_person_search(settings):
            return None
        if settings.joints:
            return BodyInMesh.known(_joint_array(settings.joints, self._character.id))
        mesh = Mesh(self._character.vertices.astype(np.float64), self._character.faces, self._character.id)
        if settings.how == "mapped":
            return find_body_in_mesh(mesh, self._graph, ends)
        person = find_person_in_mesh(mesh, ends) if self._person is None else self._person()
        return person if person is not None and (person.certain or settings.ends) else None

    @cached_property
    def stand(self) -> Float:
        """(3,) metres of the rest space: the point on the floor at which a performer stands in the mesh.

        It is the origin, or the middle of the mesh if the mesh is far from the origin. That happens for a
        character that stands aside in its project, and for a scan that is put next to another character.
        """
        corners = self._character.vertices[:, [0, 2]]
        low, high = corners.min(0).astype(np.float64), corners.max(0).astype(np.float64)
        away = np.maximum(np.maximum(low, -high), 0.0)
        if np.linalg.norm(away) <= self._max_mesh_distance():
            return np.zeros(3)
        middle = 0.5 * (low + high)
        if self.likeness is not None:
            middle = self.likeness.joints[list(_TRUNK_JOINTS)][:, [0, 2]].mean(0)
        return np.array([middle[0], 0.0, middle[1]])

    def _max_mesh_distance(self) -> float:
        """Returns the maximum distance, in the rest space, from the mesh to the origin for a performer to
        stand there.
        """
        settings = self.settings
        metres = settings.farthest_reach if settings.stand == "modelled" else _MAX_ORIGIN_DISTANCE_M
        scale = settings.height_ratio * _USUAL_HEIGHT_M / self.height
        return metres / (self.size if settings.scaled == "nobody" else scale)

    def waiting_placement(self, body: Body, farther: float = 0.0) -> Placement:
        """Returns the placement of a mesh that waits for its first performer. It is moved to the left by
        another ``farther`` metres.
        """
        at = self.placement_at(body)
        metres = farther + (0.0 if self.settings.how == "inside" else self.settings.aside)
        return shift_left(at, metres) if metres else at

    def placement_at(self, body: Body) -> Placement:
        """Returns the placement at the performer's position, with the mesh's front in the performer's
        heading.
        """
        scales_mesh = self.settings.scaled == "mesh"
        front = 0.0 if self.likeness is None else self.likeness.yaw
        return placement_under_hips(
            body, self._performer_scale(body) if scales_mesh else self.size, self.stand, front
        )

    def rest_transforms(
        self,
        body: Body,
        placement: Placement,
        earlier: list[RestTransform],
        own_earlier: RestTransform | None = None,
    ) -> list[RestTransform]:
        """Returns the transforms with which a body may attach, the best first.

        Args:
            placement: where the mesh stands.
            earlier: the transforms of the present holds that are kept, of other bodies or of this one.
            own_earlier: the transform of the body's present hold, kept or not. If the mesh stands next to the
                performer, the new hold continues with this transform, so that attaching again moves nothing.
        """
        settings, scale = self.settings, self._performer_scale(body)
        inside = settings.how == "inside"
        if not inside and isinstance(own_earlier, LimbRetargeting):
            return [own_earlier]
        if self.likeness is not None and not (inside and earlier):
            front = self._mesh_heading(self.placement_at(body) if inside else placement)
            new = LimbRetargeting(
                self.likeness, body, scale, settings.travel, settings.fade, settings.fade_pace, inside, front
            )
            if isinstance(own_earlier, LimbRetargeting):
                new.continue_from(own_earlier)
            return [new]
        mapped = next((transform for transform in earlier if isinstance(transform, LimbRetargeting)), None)
        if mapped is not None and mapped.body == body.id:
            return [mapped]
        places = [
            transform.placement for transform in earlier[:1] if isinstance(transform, PlacementTransform)
        ]
        if inside and mapped is not None:
            places = [placement]
        elif inside and settings.place == "fixed" and not places:
            fixed = scale if settings.scaled == "performer" else AS_MODELLED.scale
            places = [Placement(fixed, placement.yaw, placement.offset)]
        elif not inside or not places:
            places.append(placement_under_hips(body, scale, self.stand))
        return [PlacementTransform(place, settings.travel, not inside) for place in places]

    def _mesh_heading(self, placement: Placement) -> float:
        """Returns the heading of the mesh at rest in the world, radians about +Y."""
        return placement.yaw + (0.0 if self.likeness is None else self.likeness.yaw)

    def approach_transform(self, body: Body, placement: Placement) -> LimbRetargeting | None:
        """Returns the transform with which a waiting mesh takes a performer's pose, or None if it keeps its
        own pose.

        Args:
            placement: where the mesh waits.
        """
        settings, likeness = self.settings, self.likeness
        if not settings.ahead or likeness is None or not likeness.human:
            return None
        scale, front = self._performer_scale(body), self._mesh_heading(placement)
        return LimbRetargeting(likeness, body, scale, 0.0, settings.fade, settings.fade_pace, front=front)

    def _performer_scale(self, body: Body) -> float:
        """Returns the metres of the performer per metre of the rest space."""
        if self.settings.scaled == "nobody":
            return self.size
        return self.settings.height_ratio * body.height / self.height


def _joint_array(joints: tuple[tuple[float, float, float], ...], character: str) -> Float:
    """Returns joints as (20, 3) metres.

    Raises:
        InputError: if their number is not 20.
    """
    if len(joints) != J:
        mend = f"Name all {J} in their order, or none."
        raise InputError(f"there are {len(joints)} joints, expected {J}", where=character, mend=mend)
    return np.array(joints, np.float64)
