"""The tracker: depth frames in, the person's joints out."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.body import Body
from enliven.camera import unproject, world_from_level_camera
from enliven.frames import DepthFrame
from enliven_edge.tracking import model
from enliven_edge.tracking.detection import detect, quality
from enliven_edge.tracking.fit import FitReport, Fitter
from enliven_edge.tracking.floor import world_from_floor
from enliven_edge.tracking.foreground import Room, candidates, people
from enliven_edge.tracking.observation import Observation, WorkingCamera, observe, world_points
from enliven_edge.tracking.posture import Posture, continued
from enliven_edge.tracking.reach import within_reach
from enliven_edge.tracking.recovery import SecondThoughts
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.smoothing import OneEuro

_GOOD, _ACCEPTABLE = 0.6, 0.45
_FEWEST_PIXELS = 60
_MOVED = 0.02
"""Change of a sensor's pose, metres or entry of its rotation, beyond which the room is learnt anew."""
_PUT_ELSEWHERE = 0.25
"""And beyond which the person is looked for anew: the room would otherwise be taken for them."""
_LOOK_EVERY, _ENOUGH_DEPTH = 15, 0.1
_CLEARLY = 0.05
"""How much better a less likely group of pixels must be explained to be taken for the person."""


class Tracker:
    """One person from depth alone, with no learnt weights.

    A frame goes: reduce, place in the world, take the room away, fit (or detect), smooth.
    """

    def __init__(self, settings: TrackerSettings | None = None) -> None:
        self.settings = settings or TrackerSettings()
        self._fitter = Fitter(self.settings.fit)
        self._second_thoughts = SecondThoughts(self._fitter)
        self._smooth = OneEuro(self.settings.smoothing)
        self._camera: WorkingCamera | None = None
        self._mount: Float | None = None
        self._floor_known = False
        self._looked = 0
        self._room: Room | None = None
        self._posture: Posture | None = None
        self._before: Posture | None = None
        self._fitted = 0
        self._bad = 0
        self._person = 0

    @property
    def world_from_camera(self) -> Float | None:
        """(4, 4) where the sensor was found to stand; None before the first frame."""
        return self._mount

    @property
    def posture(self) -> Posture | None:
        """The posture of the last frame, before smoothing; None while nobody is tracked."""
        return self._posture

    def track(self, frame: DepthFrame) -> list[Body]:
        """The bodies in a frame, world frame; empty where nobody is seen."""
        camera, mount = self._place(frame)
        z = camera.reduce(frame.depth)
        points = world_points(z, camera.ray, mount)
        assert self._room is not None
        scene = self.settings.scene
        mask = candidates(z, points, self._room, scene, guess=False)
        report, observation, person = self._follow(z, points, mask, camera, mount)
        if report is None:
            mask = candidates(z, points, self._room, scene, guess=True)
            report, observation, person = self._find(z, points, mask, camera, mount)
        self._room.learn(z, person)
        if report is None or observation is None or self._posture is None:
            return []
        joints = self._smooth(self._posture.joints(), frame.time_ns)
        capsule = _capsule_confidence(report, observation, self._posture)
        return [Body(self._person, joints, _joint_confidence(capsule))]

    def _place(self, frame: DepthFrame) -> tuple[WorkingCamera, Float]:
        """The working camera and where it stands, found once a sensor (a moving sensor tells it itself)."""
        if self._camera is None or self._camera.full != frame.intrinsics:
            self._camera = WorkingCamera(frame.intrinsics, self.settings.scene.working_width)
            self._room, self._mount, self._posture = self._empty_room(), None, None
            self._floor_known, self._looked = False, 0
        if frame.world_from_camera is not None:
            given = np.asarray(frame.world_from_camera, float)
            moved = 0.0 if self._mount is None else float(np.abs(given - self._mount).max())
            if moved > _MOVED:
                self._room = self._empty_room()
            if moved > _PUT_ELSEWHERE:
                self._posture = self._before = None
            self._mount, self._floor_known = given, True
        elif not self._floor_known and self._posture is None:
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

    def _follow(
        self, z: Float, points: Float, mask: Bool, camera: WorkingCamera, mount: Float
    ) -> tuple[FitReport | None, Observation | None, Bool]:
        """Fits from the last frame's posture; no report where that fails for too long."""
        nobody = np.zeros(z.shape, bool)
        if self._posture is None:
            return None, None, nobody
        predicted = self._predicted()
        person = within_reach(z, points, mask, predicted)
        if np.count_nonzero(person) < _FEWEST_PIXELS:
            return self._lose(nobody)
        observation = observe(z, points, person, camera, mount, self.settings.fit.points)
        proportions = self._proportions()
        posture, report = self._fitter.fit(
            observation, predicted, predicted=predicted, proportions=proportions
        )
        certain = _capsule_confidence(report, observation, posture)
        posture, report = self._second_thoughts.reconsider(observation, posture, report, certain)
        good = quality(report) > _ACCEPTABLE
        self._bad = 0 if good else self._bad + 1
        if self._bad > self.settings.lost_after:
            return self._lose(person)
        self._before, self._posture = self._posture, posture
        self._fitted += good
        return report, observation, person

    def _lose(self, person: Bool) -> tuple[None, None, Bool]:
        """Gives the person up, so that the next step looks anew."""
        self._posture = self._before = None
        self._bad = 0
        return None, None, person

    def _find(
        self, z: Float, points: Float, mask: Bool, camera: WorkingCamera, mount: Float
    ) -> tuple[FitReport | None, Observation | None, Bool]:
        """Detects the likeliest person among the groups of pixels that could be one."""
        intrinsics = camera.intrinsics
        groups = people(z, points, mask, 1.0 / (intrinsics.fx * intrinsics.fy))[:3]
        best: tuple[float, Posture, FitReport, Observation, Bool] | None = None
        for group in groups:
            if np.count_nonzero(group) < _FEWEST_PIXELS:
                continue
            observation = observe(z, points, group, camera, mount, self.settings.fit.points)
            posture, report = detect(self._fitter, observation, mount[:3, 3], self.settings.body_height)
            if best is None or quality(report) > best[0] + _CLEARLY:
                best = (quality(report), posture, report, observation, group)
        everyone = np.any(groups, axis=0) if groups else np.zeros(z.shape, bool)
        if best is None or best[0] < _GOOD:
            return None, None, everyone
        _, self._posture, report, observation, person = best
        self._before, self._fitted, self._bad = None, 0, 0
        self._person += 1
        self._second_thoughts = SecondThoughts(self._fitter)
        self._smooth.reset()
        return report, observation, person

    def _predicted(self) -> Posture:
        """Where the posture is expected now, by the motion between the last two frames."""
        assert self._posture is not None
        return self._posture.copy() if self._before is None else continued(self._before, self._posture)

    def _proportions(self) -> Float | None:
        """How firmly the bones' lengths are held: softer at first, frozen once settled."""
        settings = self.settings.fit
        if self._fitted > 3 * settings.settle_frames:
            return None
        firmness = settings.proportions * (1.0 + 30.0 * self._fitted / settings.settle_frames)
        return np.full(len(model.LENGTHS), firmness)


def _capsule_confidence(report: FitReport, observation: Observation, posture: Posture) -> Float:
    """(C,) how far each capsule is supported by the points it explains, and not seen through."""
    expected = _expected_support(posture, len(observation.points))
    supported = np.minimum(1.0, report.support / np.maximum(1.0, 0.35 * expected))
    return np.asarray(supported * (1.0 - report.violated))


def _joint_confidence(capsule: Float) -> Float:
    """(20,) the joints' confidence from the capsules'."""
    confidence = np.zeros(20)
    for joint, value in zip(model.CAPSULES.joint, capsule, strict=True):
        confidence[joint] = max(confidence[joint], value)
    for joint, source in _BORROWED.items():
        confidence[joint] = confidence[source]
    return confidence


_BORROWED = {4: 5, 8: 9, 12: 13, 16: 17}
"""Shoulders and hips have no capsule of their own: their limb's first bone vouches for them."""


def _expected_support(posture: Posture, count: int) -> Float:
    """(C,) points each capsule would get if all of the body were seen, by its frontal area."""
    ends, radii = posture.capsules()
    area = (np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) + radii.sum(1)) * radii.sum(1)
    return np.asarray(count * area / area.sum())
