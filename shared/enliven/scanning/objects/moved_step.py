"""The result of an image in a scan of an object that is moved: the poses of room and object."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from enliven.arrays import Float
from enliven.scanning.objects.follower import ObjectTrackingResult
from enliven.scanning.scanner import ScanState, ScanStep


class ObjectState(Enum):
    """The state of the object in a frame."""

    RESTING = "resting"
    """It stands, and the image was fused into it. Before it is first moved, it is part of the room."""
    SETTLING = "settling"
    """Something stands still. It is not known yet if it is the object, and in which pose."""
    FOLLOWED = "followed"
    """It moves, or may move; the image was fused into the object's own model."""
    LOST = "lost"
    """It is carried, occluded, or elsewhere; nothing was fused into it."""


@dataclass(frozen=True)
class MovedStep:
    """The result of a frame.

    Attributes:
        scan: step of the room's scan since the object last came to rest, with the camera's pose in it.
        state: see :class:`ObjectState`.
        object_from_room: (4, 4) the object's pose in that room, or None while it is unknown; the object's
            frame is the first room.
        rests: the number of rests in which it was found.
        sought: number of failed searches for the object since the scene stands still.
        followed: the tracking result while the object is tracked.
    """

    scan: ScanStep
    state: ObjectState
    object_from_room: Float | None
    rests: int
    sought: int = 0
    followed: ObjectTrackingResult | None = None

    @property
    def scan_step(self) -> ScanStep:
        """The scan's step, LOST while the object is lost. While the object is tracked, the camera pose is
        in its frame.
        """
        if self.followed is not None and self.state is ObjectState.FOLLOWED:
            followed = self.followed
            return ScanStep(
                ScanState.SCANNING, followed.object_from_camera, followed.alignment, self.scan.room
            )
        return replace(self.scan, state=ScanState.LOST) if self.state is ObjectState.LOST else self.scan

    @property
    def object_from_camera(self) -> Float | None:
        """(4, 4) the camera's pose in the object's frame, or None while it is unknown."""
        if self.followed is not None:
            return self.followed.object_from_camera if self.state is ObjectState.FOLLOWED else None
        if self.object_from_room is None or self.scan.state is not ScanState.SCANNING:
            return None
        return np.asarray(self.object_from_room @ self.scan.world_from_camera)
