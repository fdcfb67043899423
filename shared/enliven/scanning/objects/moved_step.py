"""The result of processing one image in a scan of a moved object: the poses of room and object."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from enliven.arrays import Float
from enliven.scanning.objects.follower import ObjectTrackingResult
from enliven.scanning.scanner import ScanState, ScanStep


class ObjectState(Enum):
    """The state of the moved object in a frame."""

    RESTING = "resting"
    """The object stands still, and the image was fused into it. Before it is first moved, it is part of the
    room."""
    SETTLING = "settling"
    """The scene stands still again, but the object was not found in it yet."""
    FOLLOWED = "followed"
    """The object moves, or may move. The image was fused into the object's own model."""
    LOST = "lost"
    """The object is carried, occluded, or out of view. Nothing was fused into it."""


@dataclass(frozen=True)
class MovedStep:
    """The result of a frame in a scan of a moved object.

    Attributes:
        scan: the step of the current room scan, with the camera's pose in this room. This scan began when the
            object last came to rest.
        state: see :class:`ObjectState`.
        object_from_room: (4, 4) transform from that room to the object's frame, or None while the object's
            pose is unknown. The object's frame is the world of the first room scan.
        rests: the number of rests in which the object was found.
        sought: the number of failed searches for the object since the scene last came to rest.
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
            tracking = self.followed
            return ScanStep(
                ScanState.SCANNING, tracking.object_from_camera, tracking.alignment, self.scan.has_memory
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
