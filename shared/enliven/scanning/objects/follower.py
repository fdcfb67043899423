"""An object that moves is followed: each image is laid onto what is known of it, apart from the room."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from enliven import rotation
from enliven.arrays import Bool, Float
from enliven.frames import DepthFrame
from enliven.scanning.camera_tracker import Alignment, CameraTracker
from enliven.scanning.depth_view import DepthView, only
from enliven.scanning.loops import FrameHistory
from enliven.scanning.objects.nearness import distances_in
from enliven.scanning.objects.object_model import ObjectModel
from enliven.scanning.objects.rest import ObjectRest
from enliven.scanning.rigid import inverse
from enliven.scanning.settings import ScanSettings

_NEAR = 1
"""Number of the volume, with voxels of 16 mm, that tells which points lie on a surface."""
_FAR = 2
"""Number of the volume, with voxels of 64 mm, that tells which points may lie on it."""
_ABOUT = 0.06
"""Metres from the surface within which a point helps to find the object: it may have moved so far."""
_ABOUT_FAR = 0.2
"""Metres of the same where it was lost: what the coarsest voxels know about a surface."""
_LIFTS = 0.06, 0.12, 0.18
"""Metres by which it is sought above where it was: it is seen to move when it is off already."""
_TURNS = 0.1, -0.1, 0.2, -0.2
"""Radians about the way up by which it is sought turned: 6 and 11 degrees."""
_OWN = 0.02
"""Metres from it within which a point is the object's: a pixel's noise, and what the pose may be off."""
_ROOM = 0.015
"""Metres from the room's surface within which a point is the room's."""
_MARGIN = 0.03
"""Metres that a point may lie outside of what is known of the object: a new side that comes into view."""
_GROWN = 2.5
"""Times the first size to which what is known may grow: of a thing seen from one side half is known."""
_FRESH = 10
"""Images after which an object that never stood still is known well enough to say how sure its pose is: the
noise of fewer looks like slopes that turn."""
_FEWEST = 150
"""Half-size pixels of an object by which it can be followed: a hand's width at two metres."""
_TURNED = 0.5
"""Radians from one image to the next beyond which it is another pose that looks alike."""
_MOVED = 0.15
"""Metres from one image to the next, of the object's middle, beyond which it is another place."""


@dataclass(frozen=True)
class Followed:
    """An object in an image.

    Attributes:
        sure: whether it was found; nothing is fused else.
        object_from_camera: (4, 4) the camera's pose in the object's frame, the last one known if not.
        own: (h, w) half-size pixels that may be the object's: the room is tracked without them.
        alignment: how well it fits; None where there is too little of it.
    """

    sure: bool
    object_from_camera: Float
    own: Bool
    alignment: Alignment | None


class ObjectFollower:
    """Follows one object, by its own surface, through the images in which it moves.

    The object's pixels are those near its surface as it would lie if it went on as it went; they are laid
    onto that surface as a camera's image is laid onto a room (Ruenz and Agapito, "Co-Fusion", ICRA 2017,
    section V). What is new beside it, above the ground and not of the room, is fused where the pose is sure.

    Args:
        model: what is known of it, which grows.
        rest: the room, and where the object stood in it.
        object_from_camera: (4, 4) the camera's pose in the object's frame before it moved.
    """

    def __init__(
        self, model: ObjectModel, rest: ObjectRest, object_from_camera: Float, settings: ScanSettings
    ) -> None:
        self.settings, self._model, self._rest = settings, model, rest
        self._pose = self._likely = object_from_camera
        self._going = np.eye(4)
        self._most = _GROWN * model.size
        self.history = FrameHistory(settings.loops.history)
        self.poses: list[Float] = []
        self.missed = 0
        self._fresh = 0 if rest.numbers else _FRESH

    @property
    def pose(self) -> Float:
        """(4, 4) the camera's newest pose in the object's frame."""
        return self._pose

    def find(self, view: DepthView, room_from_camera: Float) -> Followed:
        """Returns where the object is in an image, before the room is looked for in it.

        Args:
            room_from_camera: (4, 4) about where the camera is in the room.
        """
        found = self._aligned(view, self._likely, room_from_camera)
        if found is None or not self._holds(found):
            starts = [self._likely, self._pose, *self._begun(room_from_camera)]
            again = (self._aligned(view, start, room_from_camera, _FAR) for start in starts)
            there = [one for one in (found, *again) if one is not None]
            found = max(there, key=lambda one: (self._holds(one), _fit(one)), default=None)
        sure = found is not None and self._holds(found)
        pose = found.world_from_camera if sure and found is not None else self._pose
        distance = distances_in(self._model.volumes[_FAR], view, pose)
        own = np.abs(distance) < _ABOUT
        return Followed(sure, pose, own & self._above(view, room_from_camera), found)

    def _begun(self, room_from_camera: Float) -> list[Float]:
        """Returns (4, 4) poses of the camera about an object that was lifted or turned since then."""
        ground = self._rest.ground
        up = np.array([0.0, 1.0, 0.0]) if ground is None else ground.normal
        up = self._pose[:3, :3] @ room_from_camera[:3, :3].T @ up
        middle, poses = self._model.middle, list[Float]()
        for height in _LIFTS:
            # As the object rises the camera sinks, as the object sees it.
            pose = self._pose.copy()
            pose[:3, 3] -= height * up
            poses.append(pose)
        for angle in _TURNS:
            turn, pose = rotation.to_matrix(rotation.from_rotation_vector(angle * up)), self._pose.copy()
            pose[:3, :3] = turn @ pose[:3, :3]
            pose[:3, 3] = middle + turn @ (pose[:3, 3] - middle)
            poses.append(pose)
        return poses

    def take(self, frame: DepthFrame, view: DepthView, found: Followed, room_from_camera: Float) -> None:
        """Goes on with what was found, and fuses it where it is sure.

        Args:
            room_from_camera: (4, 4) where the camera is in the room, as it was found.
        """
        if not found.sure:
            self.missed += 1
            self._likely = self._likely @ self._going
            return
        if not self.missed:
            self._going = inverse(self._pose) @ found.object_from_camera
        self.missed, self._pose = 0, found.object_from_camera
        self._likely = self._pose @ self._going
        own, known = self.own(view, room_from_camera)
        self._model.fuse(only(view, own), self._pose)
        if self._model.size < self._most:
            points = view.points[known] @ self._pose[:3, :3].T + self._pose[:3, 3]
            self._model.grow(points)
        self.history.add(len(self.poses), frame)
        self.poses.append(self._pose)

    def own(self, view: DepthView, room_from_camera: Float) -> tuple[Bool, Bool]:
        """Returns (h, w) which points are fused, and of them those that were known already."""
        distance = distances_in(self._model.volumes[_NEAR], view, self._pose)
        known = np.abs(distance) < _OWN
        # What stands before a known surface, in air that was seen through, is a hand.
        new = np.isnan(distance) | (distance < -_OWN)
        local = view.points @ self._pose[:3, :3].T + self._pose[:3, 3]
        may = self._model.reaches(local, _MARGIN) & self._above(view, room_from_camera)
        own = (known | (new & ~self._of_room(view, room_from_camera))) & may & (view.worth > 0)
        return own, own & known

    def views(self) -> Iterator[tuple[DepthView, Float]]:
        """Yields the images that were fused, of each what lies on the surface as it is now; and poses."""
        scanner = self._rest.scanner
        for number, frame in self.history.frames():
            view, pose = scanner.prepared(frame), self.poses[number]
            distance = distances_in(self._model.volumes[_NEAR], view, pose)
            yield only(view, np.abs(distance) < _OWN), pose

    def _aligned(
        self, view: DepthView, start: Float, room_from_camera: Float, coarsest: int = 1
    ) -> Alignment | None:
        """Returns the pose near a start at which the points about it fit best; None where there are few."""
        near = np.abs(distances_in(self._model.volumes[_FAR], view, start)) < (
            _ABOUT if coarsest < _FAR else _ABOUT_FAR
        )
        near &= self._above(view, room_from_camera)
        if np.count_nonzero(near) < _FEWEST:
            return None
        tracker = CameraTracker(self._model.volumes, self.settings.tracking)
        return tracker.align(only(view, near), start, coarsest=coarsest)

    def _holds(self, found: Alignment) -> bool:
        """Returns whether an alignment tells surely where the object is."""
        s = self.settings.tracking
        if found.overlap < s.overlap or found.agreeing < s.agreeing:
            return False
        if found.deviation > self.settings.moved.unsure and len(self.poses) >= self._fresh:
            return False
        # How the object moved before the camera, about its own middle.
        step = inverse(found.world_from_camera) @ self._pose
        cosine = (np.trace(step[:3, :3]) - 1.0) / 2.0
        middle = np.append(self._model.middle, 1.0)
        way = inverse(found.world_from_camera) @ middle - inverse(self._pose) @ middle
        images = 1 + self.missed
        return bool(cosine > np.cos(min(_TURNED * images, np.pi)) and np.linalg.norm(way) < _MOVED * images)

    def _above(self, view: DepthView, room_from_camera: Float) -> Bool:
        """Returns (h, w) which points lie above the ground."""
        ground = self._rest.ground
        if ground is None:
            return view.worth > 0
        turn, place = room_from_camera[:3, :3], room_from_camera[:3, 3]
        height = view.points @ (turn.T @ ground.normal) + (ground.normal @ place - ground.offset)
        return np.asarray((view.worth > 0) & (height > self.settings.cut_out.clearance))

    def _of_room(self, view: DepthView, room_from_camera: Float) -> Bool:
        """Returns (h, w) which points lie on the room's surface, but for where the object stood in it."""
        distance = distances_in(self._rest.scanner.volumes[_NEAR], view, room_from_camera)
        return np.asarray((np.abs(distance) < _ROOM) & ~self._rest.held(view, room_from_camera))


def _fit(found: Alignment) -> float:
    """Returns how well an image fits, to choose among several poses."""
    return found.agreeing * found.overlap
