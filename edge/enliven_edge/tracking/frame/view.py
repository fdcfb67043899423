"""One depth frame as the tracker works on it: reduced, and placed in the world."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.arrays import Float
from enliven_edge.tracking.frame.observation import WorkingCamera


@dataclass(frozen=True)
class FrameView:
    """One reduced depth frame in the world.

    Attributes:
        time_ns: the sensor's clock.
        z: (h, w) metres along the optical axis; 0 where nothing is known.
        points: (h, w, 3) the same pixels in the world frame, metres.
        camera: the working camera.
        world_from_camera: (4, 4) the pose of the sensor.
    """

    time_ns: int
    z: Float
    points: Float
    camera: WorkingCamera
    world_from_camera: Float

    @property
    def eye(self) -> Float:
        """(3,) the sensor's position, world frame."""
        return self.world_from_camera[:3, 3].copy()
