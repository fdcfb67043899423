"""The surface model of an object alone, in its own frame, which grows over several rests."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.scanning.depth_view import DepthView, restrict_view
from enliven.scanning.objects.rest import ObjectRest
from enliven.scanning.scanner import empty_volumes
from enliven.scanning.settings import ScanSettings

_MAX_IMAGES = 60
"""Maximum number of images of a rest that are fused. On a full circle, they are 6 degrees apart. Fusing them
takes 0.5 s."""
_EXTENT_MARGIN_M = 0.03
"""Points up to this distance, metres, outside the known bounding box may still belong to the object."""


class ObjectModel:
    """The known surface of an object, without the rooms in which it was seen.

    Attributes:
        volumes: the TSDF volumes in the object's frame, from the finest to the coarsest.
        is_full: True if the memory is full. No more images are then added.
    """

    def __init__(self, settings: ScanSettings) -> None:
        self.settings = settings
        self.volumes = empty_volumes(settings.volume)
        self.is_full = False
        self._box = np.array([[np.inf] * 3, [-np.inf] * 3])

    @property
    def megabytes(self) -> float:
        """Memory of the volumes, in megabytes."""
        return sum(volume.megabytes for volume in self.volumes)

    @property
    def size(self) -> float:
        """Diagonal of the bounding box of the known surface, metres; 0 if no surface is known."""
        return float(np.linalg.norm(np.ptp(self._box, axis=0))) if np.isfinite(self._box).all() else 0.0

    @property
    def middle(self) -> Float:
        """(3,) centre of the bounding box of the known surface, metres."""
        return np.asarray(self._box.mean(0))

    def contains(self, points: Float, margin: float) -> Bool:
        """Returns (...) True for points (..., 3), in the object's frame, that lie in the bounding box or
        within the margin around it.
        """
        inside = (points > self._box[0] - margin) & (points < self._box[1] + margin)
        return np.asarray(inside.all(-1))

    def fuse_rest(self, rest: ObjectRest) -> None:
        """Fuses images of a rest into the model. The object's pose in the rest must be known."""
        pose = rest.object_from_room
        if pose is None or not rest.parts:
            return
        points = rest.parts[0].vertices @ pose[:3, :3].T + pose[:3, 3]
        low, high = points.min(0), points.max(0)
        self._box = np.array([np.minimum(self._box[0], low), np.maximum(self._box[1], high)])
        numbers = rest.numbers
        for view, room_from_camera in rest.read_views(numbers[:: -(-len(numbers) // _MAX_IMAGES)]):
            self.fuse(view, pose @ room_from_camera)

    def begin(self, rest: ObjectRest) -> None:
        """Starts an object pose with only its newest image.

        Use this method if the object did not stand still long enough to fuse several images.
        """
        view = rest.scanner.view
        if view is not None and rest.object_from_room is not None and rest.parts:
            pose = rest.scanner.poses[-1][1]
            object_view = restrict_view(view, rest.object_pixels(view, pose))
            rest.images = 0
            self.grow(object_view.points[object_view.worth > 0] @ pose[:3, :3].T + pose[:3, 3])
            self.fuse(object_view, rest.object_from_room @ pose)

    def add(self, view: DepthView, rest: ObjectRest, room_from_camera: Float) -> None:
        """Fuses a new image of a rest: the points in the object's box that lie above the floor."""
        if rest.object_from_room is not None and rest.ground is not None:
            object_view = self._object_points(view, rest, room_from_camera)
            self.fuse(restrict_view(view, object_view), rest.object_from_room @ room_from_camera)

    def _object_points(self, view: DepthView, rest: ObjectRest, room_from_camera: Float) -> Bool:
        """Returns (h, w) True for each point of a view that belongs to the object."""
        assert rest.ground is not None and rest.object_from_room is not None
        room_points = view.points @ room_from_camera[:3, :3].T + room_from_camera[:3, 3]
        points = room_points @ rest.object_from_room[:3, :3].T + rest.object_from_room[:3, 3]
        is_above_floor = rest.ground.heights(room_points) > self.settings.cut_out.clearance
        return np.asarray((view.worth > 0) & self.contains(points, _EXTENT_MARGIN_M) & is_above_floor)

    def grow(self, points: Float) -> None:
        """Extends the bounding box to points (N, 3) that belong to the object."""
        if len(points):
            self._box = np.array(
                [np.minimum(self._box[0], points.min(0)), np.maximum(self._box[1], points.max(0))]
            )

    def fuse(self, view: DepthView, object_from_camera: Float) -> None:
        """Fuses a view into the model. Only the points of the view that belong to the object have weight."""
        had_memory = [volume.integrate(view, object_from_camera).has_memory for volume in self.volumes]
        self.is_full = self.is_full or not all(had_memory)
