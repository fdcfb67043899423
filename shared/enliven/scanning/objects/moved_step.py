"""What becomes of an image in a scan of an object that is moved: where room and object are in it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from enliven.arrays import Float
from enliven.scanning.objects.follower import Followed
from enliven.scanning.scanner import ScanState, ScanStep


class ObjectState(Enum):
    """What is known of the object in a frame."""

    RESTING = "resting"
    """It stands, and the image was fused into it; before it is first moved it is a part of the room."""
    SETTLING = "settling"
    """Something stands still; it is not known yet that it is the object, or how it lies."""
    FOLLOWED = "followed"
    """It moves, or may move; the image was fused into what is known of it alone."""
    LOST = "lost"
    """It is carried, covered, or elsewhere; nothing was fused into it."""


@dataclass(frozen=True)
class MovedStep:
    """What became of a frame.

    Attributes:
        scan: of the room as it is since the object last came to rest; with the camera's pose in it.
        state: see :class:`ObjectState`.
        object_from_room: (4, 4) how the object lies in that room, or None while that is not known; the
            object's frame is the first room.
        rests: the number of rests at which it was found.
        sought: how often it was looked for, in vain, in what stands still now.
        followed: where it is while it is followed.
    """

    scan: ScanStep
    state: ObjectState
    object_from_room: Float | None
    rests: int
    sought: int = 0
    followed: Followed | None = None

    @property
    def told(self) -> ScanStep:
        """The scan's step, lost while the object is; where it is followed, the camera as it sees it."""
        if self.followed is not None and self.state is ObjectState.FOLLOWED:
            found = self.followed
            return ScanStep(ScanState.SCANNING, found.object_from_camera, found.alignment, self.scan.room)
        return replace(self.scan, state=ScanState.LOST) if self.state is ObjectState.LOST else self.scan

    @property
    def object_from_camera(self) -> Float | None:
        """(4, 4) the camera's pose in the object's frame, or None while that is not known."""
        if self.followed is not None:
            return self.followed.object_from_camera if self.state is ObjectState.FOLLOWED else None
        if self.object_from_room is None or self.scan.state is not ScanState.SCANNING:
            return None
        return np.asarray(self.object_from_room @ self.scan.world_from_camera)
