"""Where the sensor stands: told by it, or found by the floor; and noticed when it was moved."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.camera import unproject, world_from_level_camera
from enliven.frames import DepthFrame
from enliven_edge.tracking.frame import FrameView, WorkingCamera, world_points
from enliven_edge.tracking.scene.floor import corrected, world_from_floor
from enliven_edge.tracking.scene.room import Agreement
from enliven_edge.tracking.settings import SceneSettings

_MOVED = 0.02
"""Change of a sensor's pose, metres or entry of its rotation, beyond which the room is learnt anew."""
_PUT_ELSEWHERE = 0.25
"""And beyond which the people are looked for anew: the room would otherwise be taken for them."""
_LOOK_EVERY, _ENOUGH_DEPTH = 15, 0.1
_CORRECT_EVERY_NS, _GAIN = 1_000_000_000, 0.15
_BOTH_WAYS = 0.08
"""Share of the room that is farther when the sensor was moved; who steps before it makes nothing farther."""
_SUSPICIOUS_FRAMES = 3
_DIFFERENT, _LOOK_AGAIN = 0.6, 15
"""Part of the share above at which the floor is looked for again, and frames between two such looks."""
_TURNED, _LIFTED = np.deg2rad(3.0), 0.12
_STILL, _STILL_FRAMES, _LONGEST_FALL_NS = 0.85, 3, 3_000_000_000
_FALLS_BY = np.deg2rad(30.0)


class Mounting:
    """The working camera and its pose, found once a sensor (a moving sensor tells it itself).

    A sensor that tells nothing is watched: where most of the known room no longer matches it was moved, and
    while it falls the floor is kept in sight from frame to frame, so that it is not taken for a wall.

    Attributes:
        world_from_camera: (4, 4), None before the first frame.
        new_camera, new_place, far_away: what the last frame changed: the sensor's kind, its pose by enough
            to learn the room anew, its pose by enough to look for everybody anew.
        falling: whether the sensor is being moved; nothing is to be believed.
    """

    def __init__(self, settings: SceneSettings, moved: float = 0.5) -> None:
        self.settings = settings
        self.world_from_camera: Float | None = None
        self.new_camera = self.new_place = self.far_away = False
        self.falling = False
        self._moved = moved
        self._camera: WorkingCamera | None = None
        self._told_by_sensor = self._floor_known = False
        self._looked = self._suspicious = self._differing = self._still = 0
        self._before: Float | None = None
        self._fell_ns = self._corrected_ns = 0

    @property
    def floor_known(self) -> bool:
        """Whether the floor was found, or the sensor told where it stands."""
        return self._floor_known

    @property
    def camera(self) -> WorkingCamera:
        assert self._camera is not None
        return self._camera

    def view(self, frame: DepthFrame, *, nobody: bool) -> FrameView:
        """The frame, reduced and placed in the world.

        Args:
            nobody: nobody is followed, so that the floor may still be looked for.
        """
        self.new_camera = self.new_place = self.far_away = False
        if self._camera is None or self._camera.full != frame.intrinsics:
            self._camera = WorkingCamera(frame.intrinsics, self.settings.working_width)
            self.new_camera, self.world_from_camera = True, None
            self._floor_known, self._looked = False, 0
            self.falling, nobody = False, True
        z = self._camera.reduce(frame.depth)
        self._told_by_sensor = frame.world_from_camera is not None
        if frame.world_from_camera is not None:
            self._told(np.asarray(frame.world_from_camera, float))
        elif self.falling:
            self._fall(z, frame.time_ns)
        elif not self._floor_known and nobody:
            self._look_for_floor(z)
        assert self.world_from_camera is not None
        points = world_points(z, self._camera.ray, self.world_from_camera)
        return FrameView(frame.time_ns, z, points, self._camera, self.world_from_camera)

    def watch(self, view: FrameView, agreement: Agreement, somebody: Bool) -> None:
        """Notices that the sensor was moved, and keeps the floor where it is.

        Args:
            agreement: of the frame with the room.
            somebody: (h, w) the pixels that are somebody's.
        """
        if self._told_by_sensor:
            return
        differs = agreement.nearer + agreement.farther
        enough = agreement.compared > 0.1 * view.z.size
        moved = differs > self._moved and agreement.farther > _BOTH_WAYS
        self._suspicious = self._suspicious + 1 if moved and enough else 0
        self._differing = self._differing + 1 if differs > _DIFFERENT * self._moved and enough else 0
        looked = self._differing % _LOOK_AGAIN == _SUSPICIOUS_FRAMES
        if self._suspicious >= _SUSPICIOUS_FRAMES or (looked and self._floor_is_elsewhere(view, somebody)):
            self._differing = 0
            self.falling, self._suspicious, self._still = True, 0, 0
            self._before, self._fell_ns = view.z, view.time_ns
        elif self._floor_known and not 0 <= view.time_ns - self._corrected_ns < _CORRECT_EVERY_NS:
            self._corrected_ns = view.time_ns
            assert self.world_from_camera is not None
            usable = ~somebody & (view.z > 0) & (view.z < self.settings.far)
            self.world_from_camera = corrected(self.world_from_camera, view.points, usable, _GAIN)

    @property
    def suspected(self) -> bool:
        """Whether so much differs from the room that the sensor may have been moved: believe nobody new."""
        return self._suspicious > 0

    def _floor_is_elsewhere(self, view: FrameView, somebody: Bool) -> bool:
        """Whether the floor lies otherwise than it did: who steps before the room moves no floor."""
        assert self.world_from_camera is not None
        if not self._floor_known:
            return False
        points = unproject(view.z * 1e3, self.camera.ray)[~somebody & (view.z > 0)]
        found = world_from_floor(points, self.settings.upside_down)
        if found is None:
            return False
        turned = float(np.arccos(min(1.0, float(found[1, :3] @ self.world_from_camera[1, :3]))))
        return turned > _TURNED or abs(float(found[1, 3] - self.world_from_camera[1, 3])) > _LIFTED

    def _told(self, given: Float) -> None:
        """The sensor says itself where it stands."""
        before = self.world_from_camera
        moved = 0.0 if before is None else float(np.abs(given - before).max())
        self.new_place, self.far_away = moved > _MOVED, moved > _PUT_ELSEWHERE
        self.world_from_camera, self._floor_known, self.falling = given, True, False

    def _fall(self, z: Float, time_ns: int) -> None:
        """A frame of a sensor that is being moved: follows the floor until the picture is still."""
        assert self._before is not None
        self._still = self._still + 1 if _alike(z, self._before) > _STILL else 0
        self._before = z
        self._follow_floor(z)
        if self._still >= _STILL_FRAMES or not 0 <= time_ns - self._fell_ns < _LONGEST_FALL_NS:
            self.falling = False
            self.new_place = self.far_away = True

    def _follow_floor(self, z: Float) -> None:
        """The floor near where it was a frame ago, or else where the mounting has it."""
        assert self.world_from_camera is not None
        known = z > 0
        if known.mean() < _ENOUGH_DEPTH:
            return
        points = unproject(z * 1e3, self.camera.ray)[known]
        found = world_from_floor(points, up=self.world_from_camera[1, :3], within=_FALLS_BY)
        if found is None:
            found = world_from_floor(points, self.settings.upside_down)
        if found is not None:
            self.world_from_camera, self._floor_known = found, True

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


def _alike(z: Float, before: Float) -> float:
    """The share of the pixels known in both frames that hardly changed."""
    both = (z > 0) & (before > 0)
    count = max(1, int(np.count_nonzero(both)))
    return float(np.count_nonzero(both & (np.abs(z - before) < 0.03 + 0.01 * z * z))) / count
