"""The tracker: depth frames in, the people's joints out."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.body import Body
from enliven.camera import unproject, world_from_level_camera
from enliven.frames import DepthFrame
from enliven_edge.tracking.fit import Fitter
from enliven_edge.tracking.floor import world_from_floor
from enliven_edge.tracking.follower import Follower
from enliven_edge.tracking.foreground import Room, candidates, people
from enliven_edge.tracking.observation import WorkingCamera, world_points
from enliven_edge.tracking.posture import Posture
from enliven_edge.tracking.reach import within_reach
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.smoothing import OneEuro
from enliven_edge.tracking.view import View

_MOVED = 0.02
"""Change of a sensor's pose, metres or entry of its rotation, beyond which the room is learnt anew."""
_PUT_ELSEWHERE = 0.25
"""And beyond which the person is looked for anew: the room would otherwise be taken for them."""
_LOOK_EVERY, _ENOUGH_DEPTH = 15, 0.1
_CLEARLY = 0.05
"""How much better a less likely group of pixels must be explained to be taken for the person."""


class Tracker:
    """People from depth alone, with no learnt weights.

    A frame goes: reduce, place in the world, take the room away, fit (or detect), smooth.
    """

    def __init__(self, settings: TrackerSettings | None = None) -> None:
        self.settings = settings or TrackerSettings()
        self._fitter = Fitter(self.settings.fit)
        self._smooth = OneEuro(self.settings.smoothing)
        self._camera: WorkingCamera | None = None
        self._mount: Float | None = None
        self._floor_known = False
        self._looked = 0
        self._room: Room | None = None
        self._follower: Follower | None = None
        self._person = 0

    @property
    def world_from_camera(self) -> Float | None:
        """(4, 4) where the sensor was found to stand; None before the first frame."""
        return self._mount

    @property
    def posture(self) -> Posture | None:
        """The posture of the last frame, before smoothing; None while nobody is tracked."""
        return None if self._follower is None else self._follower.posture

    def track(self, frame: DepthFrame) -> list[Body]:
        """The bodies in a frame, world frame; empty where nobody is seen."""
        view = self._view(frame)
        person = self._follow(view)
        if self._follower is None:
            person = person | self._find(view)
        assert self._room is not None
        self._room.learn(view.z, person)
        if self._follower is None:
            return []
        joints = self._smooth(self._follower.posture.joints(), frame.time_ns)
        return [Body(self._person, joints, self._follower.confidence)]

    def _view(self, frame: DepthFrame) -> View:
        """The frame, reduced and placed in the world."""
        camera, mount = self._place(frame)
        z = camera.reduce(frame.depth)
        return View(frame.time_ns, z, world_points(z, camera.ray, mount), camera, mount)

    def _candidates(self, view: View, *, guess: bool) -> Bool:
        assert self._room is not None
        return candidates(view.z, view.points, self._room, self.settings.scene, guess=guess)

    def _follow(self, view: View) -> Bool:
        """Fits from the last frame's posture; the (h, w) pixels that are the person's."""
        if self._follower is None:
            return np.zeros(view.z.shape, bool)
        mask = self._candidates(view, guess=False)
        person = within_reach(view.z, view.points, mask, self._follower.predicted())
        self._follower.follow(view, person)
        if self._follower.lost:
            self._follower = None
        return person

    def _find(self, view: View) -> Bool:
        """Detects the likeliest person among the groups of pixels that could be one."""
        intrinsics = view.camera.intrinsics
        mask = self._candidates(view, guess=True)
        groups = people(view.z, view.points, mask, 1.0 / (intrinsics.fx * intrinsics.fy))[:3]
        best: tuple[float, Follower, Bool] | None = None
        for group in groups:
            found = Follower.found(view, group, self.settings, self._fitter)
            if found is not None and (best is None or found[1] > best[0] + _CLEARLY):
                best = (found[1], found[0], group)
        if best is None:
            return np.any(groups, axis=0) if groups else np.zeros(view.z.shape, bool)
        self._follower = best[1]
        self._person += 1
        self._smooth.reset()
        return best[2]

    def _place(self, frame: DepthFrame) -> tuple[WorkingCamera, Float]:
        """The working camera and where it stands, found once a sensor (a moving sensor tells it itself)."""
        if self._camera is None or self._camera.full != frame.intrinsics:
            self._camera = WorkingCamera(frame.intrinsics, self.settings.scene.working_width)
            self._room, self._mount, self._follower = self._empty_room(), None, None
            self._floor_known, self._looked = False, 0
        if frame.world_from_camera is not None:
            given = np.asarray(frame.world_from_camera, float)
            moved = 0.0 if self._mount is None else float(np.abs(given - self._mount).max())
            if moved > _MOVED:
                self._room = self._empty_room()
            if moved > _PUT_ELSEWHERE:
                self._follower = None
            self._mount, self._floor_known = given, True
        elif not self._floor_known and self._follower is None:
            self._look_for_floor(frame)
        assert self._mount is not None
        return self._camera, self._mount

    def _empty_room(self) -> Room:
        assert self._camera is not None
        return Room((self._camera.intrinsics.height, self._camera.intrinsics.width))

    def _look_for_floor(self, frame: DepthFrame) -> None:
        """Sets the mounting by the floor, or as the settings say; tries again while nobody is there."""
        assert self._camera is not None
        scene = self.settings.scene
        if self._mount is None:
            roll = np.pi if scene.upside_down else 0.0
            self._mount = world_from_level_camera(scene.height, scene.tilt, roll)
        z = self._camera.reduce(frame.depth)
        known = z > 0
        if known.mean() < _ENOUGH_DEPTH:
            return  # the camera is still starting, or covered
        self._looked += 1
        if self._looked % _LOOK_EVERY == 1:
            found = world_from_floor(unproject(z * 1e3, self._camera.ray)[known], scene.upside_down)
            self._floor_known = found is not None
            self._mount = self._mount if found is None else found
