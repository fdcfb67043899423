"""The tracker: takes frames and returns the joints of the people in them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from enliven.arrays import Float, Int16, UInt8
from enliven.deformation.constraints import ObservedPoints
from enliven.errors import InputError
from enliven.frames import BodyFrame, DepthFrame, Frame
from enliven.person import Body, Joint
from enliven_edge.landmarks import ColourPoseEstimator
from enliven_edge.tracking.body_model import Posture
from enliven_edge.tracking.fit import Fitter
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.health import TrackerState
from enliven_edge.tracking.output import Output, mirror_plane, mirror_surfaces, visible_surfaces
from enliven_edge.tracking.people import GuessedFloor, MultiPersonTracker, Person
from enliven_edge.tracking.scene import UNSEEN, BackgroundModel, Mounting
from enliven_edge.tracking.segment import find_furniture, pixels_near_bodies
from enliven_edge.tracking.settings import TrackerSettings

_YOUNG_AGE_S = 1.0
"""Age of the background model in seconds up to which it may contain parts of people by mistake."""
_SURFACE_DISTANCE_M = 0.05
"""Metres from a person's surface within which a part of the background is taken for the person. It covers the
error of the fit."""
_FURNITURE_RATE_HZ = 5.0
"""Searches per second for furniture next to people. Furniture does not move, so this is enough."""

_MAX_LEG_CONFIDENCE = 0.5
"""Maximum confidence of a knee, ankle or foot while the floor is only guessed. The guessed floor plane cuts
off the shins."""
_FIRST_CONFIDENCE = 0.6
"""Maximum confidence of a joint in the frame in which its person is found. In a single frame a pattern on a
wall may fit a body."""
_CONFIDENCE_RAMP_NS = 300_000_000
"""Nanoseconds after which the limit of a new person's confidence is gone, if the network also sees a person.
A pattern loses its body within about ten frames."""
_IS_LEG = np.isin(np.arange(len(Joint)), [j for j in Joint if j.name.startswith(("KNEE", "ANKLE", "FOOT"))])


class Tracker:
    """Tracks people by depth alone.

    For each frame it reduces the depth image, places it in the world and subtracts the background. It divides
    the remaining pixels among the tracked people and fits each person. Then it searches for new people and
    smooths the result. Bodies that a sensor tracks itself are smoothed in the same way.

    Args:
        colour: improves the joints by the colour image, if the frame has one; None: depth alone.
    """

    def __init__(
        self, settings: TrackerSettings | None = None, colour: ColourPoseEstimator | None = None
    ) -> None:
        self.settings = settings or TrackerSettings()
        self._mounting = Mounting(self.settings.scene, self.settings.room.moved)
        self._fitter = Fitter(self.settings.fit)
        self._people = MultiPersonTracker(self.settings, self._fitter)
        self._guessed_floor = GuessedFloor(self.settings)
        self._room: BackgroundModel | None = None
        self._owner: Int16 | None = None
        self._view: FrameView | None = None
        self._by_depth, self._gave_up = True, 0
        self.output = Output(self.settings)
        self.colour = colour

    @property
    def world_from_camera(self) -> Float | None:
        """Returns the (4, 4) pose of the sensor.

        None before the first frame, and if the sensor tracks people itself.
        """
        return self._mounting.world_from_camera if self._by_depth else None

    @property
    def down(self) -> Float | None:
        """Returns the (3,) direction of gravity in the camera's frame. None if there is no accelerometer."""
        return self._mounting.down

    @down.setter
    def down(self, direction: Float | None) -> None:
        self._mounting.down = direction

    @property
    def performers(self) -> list[Person]:
        """Returns the tracked people that may perform, in the order in which they were found."""
        return self._people.track_manager.performers

    @property
    def bystanders(self) -> int:
        """Returns the number of visible people that are not performers: outside the zone, or locked out."""
        return self._people.finder.bystanders

    @property
    def state(self) -> TrackerState | None:
        """Returns the state after the last frame, for the health reports.

        None if the sensor tracks people itself.
        """
        if not self._by_depth:
            return None
        age = self._room.age if self._room is not None else 0.0
        moved = self._mounting.falling or (self._mounting.new_place and not self._mounting.new_camera)
        return TrackerState(self._mounting.floor_known, age, moved)

    @property
    def owner(self) -> Int16 | None:
        """Returns (h, w) the person index at each pixel of the last reduced image, -1 without a person."""
        return self._owner

    @property
    def posture(self) -> Posture | None:
        """Returns the first performer's posture in the last frame, before smoothing.

        None without a performer.
        """
        performers = self.performers
        return performers[0].follower.posture if performers else None

    def surfaces(self) -> dict[int, ObservedPoints]:
        """Returns the surface points of each performer in the last frame, by id.

        They are mirrored if the bodies are.
        """
        if self._view is None or self._owner is None or not self._by_depth:
            return {}
        surfaces = visible_surfaces(self._view, self._owner, self._people.segment_ids())
        if self.settings.output.mirror:
            return mirror_surfaces(surfaces, *mirror_plane(self.world_from_camera))
        return surfaces

    def lock(self, ids: Iterable[int] | None = None) -> None:
        """Makes these people, or all that are tracked now, the only performers. All others are bystanders.

        Raises:
            InputError: if the sensor tracks people itself.
        """
        self._need_depth()
        self._people.track_manager.lock_to(ids)

    @property
    def locked(self) -> bool:
        """Returns True if new people are bystanders."""
        return self._people.track_manager.lock.closed

    def unlock(self) -> None:
        """Lets new people be performers again. Raises InputError like :meth:`lock`."""
        self._need_depth()
        self._people.track_manager.lock.open()

    def _need_depth(self) -> None:
        """Raises InputError if the sensor tracks people itself."""
        if not self._by_depth:
            raise InputError(
                "only the performers of one depth sensor can be locked",
                where="edge",
                mend="Give the space a zone instead, zone under [tracker.scene] in the settings.",
            )

    def forget(self) -> None:
        """Drops all tracked and remembered people. The background model and the sensor's pose stay."""
        self._people.forget()
        self.output.forget()

    def track(self, frame: Frame) -> list[Body]:
        """Returns the bodies in a frame, world frame, found in its depth or by the sensor.

        The list is empty without people.
        """
        if isinstance(frame, BodyFrame):
            self._by_depth = False
            self._people.track_manager.lock.open()
            return self.output(frame.bodies, frame.time_ns, frame.world_from_camera)
        self._by_depth = True
        return self._track_depth(frame)

    def _track_depth(self, frame: DepthFrame) -> list[Body]:
        """Returns the bodies in a depth image."""
        view = self._mounting.view(frame, no_people=not self._people.people)
        room = self._background_for(view)
        if self._mounting.falling:
            self._view = None
            return []
        self._fitter.has_floor = self._mounting.height_known
        if not self._mounting.height_known and not self._people.people:
            view = self._mounting.raise_guess(view, self._guessed_floor.before_search(view, room))
        scene = self.settings.scene
        kind = room.classify(view, scene.near, scene.far, scene.floor_band)
        segments = self._people.follow(view, kind)
        hold = self._people.finder.find(view, kind, segments, room, believe=not self._mounting.suspected)
        if not self._mounting.height_known:
            view = self._raise_world(view)
        self._owner, self._view = segments.owner, view
        room.guard(segments.owner, self._people.travelled_ids(), view.z)
        people = (segments.owner >= 0) | self._people.finder.searched_pixels(view)
        agreement = room.learn(view.z, people, view.time_ns, hold)
        self._remove_learnt_people(room, view)
        self._absorb_furniture(room, view, kind)
        self._mounting.watch(view, agreement, people)
        return self._bodies(frame)

    def _raise_world(self, view: FrameView) -> FrameView:
        """Corrects the guessed floor by the people's soles.

        The people stay at the same place in the image.
        """
        step = self._guessed_floor.after_fit(self._people.people)
        for person in self._people.people:
            person.lift(step)
        return self._mounting.raise_guess(view, step)

    def _remove_learnt_people(self, room: BackgroundModel, view: FrameView) -> None:
        """Removes parts of people from the background model that it learnt in the first frames.

        An example is a leg below a hole in the depth.
        """
        people = [p.follower.posture for p in self._people.people if not p.travelled]
        if people and room.age < _YOUNG_AGE_S:
            room.forget(pixels_near_bodies(view, people, self.settings.scene.floor_band, _SURFACE_DISTANCE_M))

    def _absorb_furniture(self, room: BackgroundModel, view: FrameView, kind: UInt8) -> None:
        """Adds pixels that touch people and never move to the background model.

        They are furniture that was there when the people were first seen.
        """
        people = [p.follower.posture for p in self._people.people]
        if people and self._owner is not None and round(room.age * _FURNITURE_RATE_HZ) != self._gave_up:
            self._gave_up = round(room.age * _FURNITURE_RATE_HZ)
            floor = self.settings.scene.floor_band
            still = room.still_pixels(view.z) & (kind == UNSEEN)
            room.absorb(find_furniture(view, still, self._owner, people, floor))

    def _background_for(self, view: FrameView) -> BackgroundModel:
        """Returns the background model: a new one if the sensor was moved or exchanged."""
        mounting = self._mounting
        if mounting.new_camera or mounting.levelled or (mounting.new_place and mounting.far_away):
            self._people.sensor_moved(view.time_ns)
        if self._room is None or mounting.new_camera or mounting.new_place:
            self._room = BackgroundModel(view.z.shape, self.settings.room)
        return self._room

    def _limit_confidence(self, sure: Float, age_ns: int) -> Float:
        """Returns (20,) the confidence of a person's joints, with limits.

        It is limited while the person is new, and for legs while the floor is unknown.

        Args:
            sure: (20,) the confidence from the fit.
            age_ns: nanoseconds since the person was found.
        """
        earned = min(max(age_ns / _CONFIDENCE_RAMP_NS, 0.0), 1.0)
        if earned == 1.0 and self._mounting.floor_known:
            return sure
        legs = 1.0 if self._mounting.floor_known else _MAX_LEG_CONFIDENCE
        most = np.minimum(
            _FIRST_CONFIDENCE + (1.0 - _FIRST_CONFIDENCE) * earned, np.where(_IS_LEG, legs, 1.0)
        )
        return np.minimum(sure, most)

    def _bodies(self, frame: DepthFrame) -> list[Body]:
        """Returns the output bodies: each performer's fit, processed according to the settings."""
        fits = []
        for person in self.performers:
            posture, sure = person.follower.posture, person.follower.confidence
            age = frame.time_ns - person.found_ns if person.plain else 0
            sure = self._limit_confidence(sure, age)
            turns, stature = posture.orientations(), person.looks.stature
            fits.append(Body(person.id, posture.joints(), sure, turns, stature=stature))
        if self.colour is not None and self.world_from_camera is not None:
            fits = self.colour.improve(fits, frame, self.world_from_camera)
        return self.output(fits, frame.time_ns, self.world_from_camera)
