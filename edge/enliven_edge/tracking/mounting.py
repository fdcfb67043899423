"""Where the sensor stands: told by it, or found by the floor; and noticed when it was moved."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.camera import unproject, world_from_level_camera
from enliven.frames import DepthFrame
from enliven_edge.tracking.floor import world_from_floor
from enliven_edge.tracking.observation import WorkingCamera, world_points
from enliven_edge.tracking.settings import SceneSettings
from enliven_edge.tracking.view import View

_MOVED = 0.02
"""Change of a sensor's pose, metres or entry of its rotation, beyond which the room is learnt anew."""
_PUT_ELSEWHERE = 0.25
"""And beyond which the people are looked for anew: the room would otherwise be taken for them."""
_LOOK_EVERY, _ENOUGH_DEPTH = 15, 0.1


class Mounting:
    """The working camera and its pose, found once a sensor (a moving sensor tells it itself).

    Attributes:
        world_from_camera: (4, 4), None before the first frame.
        new_camera, new_place, far_away: what the last frame changed: the sensor's kind, its pose by enough
            to learn the room anew, its pose by enough to look for everybody anew.
    """

    def __init__(self, settings: SceneSettings) -> None:
        self.settings = settings
        self.world_from_camera: Float | None = None
        self.new_camera = self.new_place = self.far_away = False
        self._camera: WorkingCamera | None = None
        self._floor_known = False
        self._looked = 0

    @property
    def floor_known(self) -> bool:
        """Whether the floor was found, or the sensor told where it stands."""
        return self._floor_known

    @property
    def camera(self) -> WorkingCamera:
        assert self._camera is not None
        return self._camera

    def view(self, frame: DepthFrame, *, nobody: bool) -> View:
        """The frame, reduced and placed in the world.

        Args:
            nobody: nobody is followed, so that the floor may still be looked for.
        """
        self.new_camera = self.new_place = self.far_away = False
        if self._camera is None or self._camera.full != frame.intrinsics:
            self._camera = WorkingCamera(frame.intrinsics, self.settings.working_width)
            self.new_camera, self.world_from_camera = True, None
            self._floor_known, self._looked = False, 0
            nobody = True
        z = self._camera.reduce(frame.depth)
        if frame.world_from_camera is not None:
            self._told(np.asarray(frame.world_from_camera, float))
        elif not self._floor_known and nobody:
            self._look_for_floor(z)
        assert self.world_from_camera is not None
        points = world_points(z, self._camera.ray, self.world_from_camera)
        return View(frame.time_ns, z, points, self._camera, self.world_from_camera)

    def _told(self, given: Float) -> None:
        """The sensor says itself where it stands."""
        before = self.world_from_camera
        moved = 0.0 if before is None else float(np.abs(given - before).max())
        self.new_place, self.far_away = moved > _MOVED, moved > _PUT_ELSEWHERE
        self.world_from_camera, self._floor_known = given, True

    def _look_for_floor(self, z: Float) -> None:
        """Sets the mounting by the floor, or as the settings say; tries again while nobody is there."""
        scene = self.settings
        if self.world_from_camera is None:
            roll = np.pi if scene.upside_down else 0.0
            self.world_from_camera = world_from_level_camera(scene.height, scene.tilt, roll)
        known = z > 0
        if known.mean() < _ENOUGH_DEPTH:
            return  # the camera is still starting, or covered
        self._looked += 1
        if self._looked % _LOOK_EVERY == 1:
            found = world_from_floor(unproject(z * 1e3, self.camera.ray)[known], scene.upside_down)
            self._floor_known = found is not None
            self.world_from_camera = self.world_from_camera if found is None else found
