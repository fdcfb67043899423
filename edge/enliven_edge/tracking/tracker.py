"""The tracker: takes frames and returns the joints of the people in them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from enliven.arrays import Float, Int16, UInt8
from enliven.deformation.constraints.observed import ObservedPoints
from enliven.errors import InputError
from enliven.frames import BodyFrame, DepthFrame, Frame
from enliven.person import Body, Joint
from enliven_edge.landmarks.colour_pose import ColourPoseEstimator
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.health.health import TrackerState
from enliven_edge.tracking.output.output import Output, mirror_plane
from enliven_edge.tracking.output.surfaces import collect_visible_surfaces, mirror_surfaces
from enliven_edge.tracking.people.guessed_floor import FloorEstimator
from enliven_edge.tracking.people.people import MultiPersonTracker
from enliven_edge.tracking.people.person import Person
from enliven_edge.tracking.scene.background_kernels import UNSEEN
from enliven_edge.tracking.scene.background_model import BackgroundModel
from enliven_edge.tracking.scene.mounting import Mounting
from enliven_edge.tracking.segment.furniture import find_furniture
from enliven_edge.tracking.segment.segmentation import pixels_near_bodies
from enliven_edge.tracking.settings import TrackerSettings

_YOUNG_AGE_S = 1.0
"""Age in seconds below which the background model may still contain parts of people by mistake."""
_SURFACE_DISTANCE_M = 0.05
"""Background pixels within this distance of a fitted person, in metres, are removed from the background
model. It covers the error of the fit."""
_FURNITURE_RATE_HZ = 5.0
"""Searches per second for furniture next to people. Furniture does not move, so this is enough."""

_MAX_LEG_CONFIDENCE = 0.5
"""Maximum confidence of a knee, ankle or foot while the floor is only guessed. The guessed floor plane cuts
off the shins."""
_FIRST_CONFIDENCE = 0.6
"""Maximum confidence of the joints in a person's first frame. It is limited, because in a single frame a
pattern on a wall may look like a body.
"""
_CONFIDENCE_RAMP_NS = 300_000_000
"""Nanoseconds over which the confidence limit of a new person rises to 1, if the network also sees a person.
A false body on a wall pattern is lost within about ten frames.
"""
_IS_LEG = np.isin(np.arange(len(Joint)), [j for j in Joint if j.name.startswith(("KNEE", "ANKLE", "FOOT"))])


class Tracker:
    """Tracks people by depth alone.

    For each frame it reduces the depth image, transforms it to the world frame and subtracts the background.
    It divides the remaining pixels among the tracked people and fits each person. Then it searches for new
    people and smooths the result. Bodies that a sensor tracks itself are smoothed in the same way.

    Args:
        colour: estimator that improves the joints with the colour image of a frame, if there is one. If None,
            uses depth alone.
    """

    def __init__(
        self, settings: TrackerSettings | None = None, colour: ColourPoseEstimator | None = None
    ) -> None:
        self.settings = settings or TrackerSettings()
        self._mounting = Mounting(self.settings.scene)
        self._fitter = Fitter(self.settings.fit)
        self._people = MultiPersonTracker(self.settings, self._fitter)
        self._guessed_floor = FloorEstimator(self.settings)
        self._room: BackgroundModel | None = None
        self._owner: Int16 | None = None
        self._view: FrameView | None = None
        self._by_depth, self._gave_up = True, 0
        self._learns_again = False
        self.output = Output(self.settings)
        self.colour = colour

    @property
    def world_from_camera(self) -> Float | None:
        """Returns the (4, 4) pose of the sensor.

        Returns None before the first frame, and if the sensor tracks people itself.
        """
        return self._mounting.world_from_camera if self._by_depth else None

    @property
    def down(self) -> Float | None:
        """Returns the (3,) direction of gravity in the camera's frame, or None without an accelerometer."""
        return self._mounting.down

    @down.setter
    def down(self, direction: Float | None) -> None:
        self._mounting.down = direction

    @property
    def performers(self) -> list[Person]:
        """Returns the tracked people who may perform, in the order of their detection."""
        return self._people.track_manager.performers

    @property
    def bystanders(self) -> int:
        """Returns the number of visible people who are not performers: outside the zone, or locked out."""
        return self._people.finder.bystanders

    @property
    def state(self) -> TrackerState | None:
        """Returns the state after the last frame, for the health reports.

        Returns None if the sensor tracks people itself.
        """
        if not self._by_depth:
            return None
        age = self._room.age if self._room is not None else 0.0
        moved = self._mounting.is_moving or (self._mounting.has_new_pose and not self._mounting.is_new_camera)
        return TrackerState(self._mounting.is_floor_known, age, moved)

    @property
    def background(self) -> Float | None:
        """Returns the background's depth (h, w) in the reduced image, metres, 0 where it is unknown.

        Returns None before the first depth image.
        """
        return None if self._room is None else self._room.z

    @property
    def owner(self) -> Int16 | None:
        """Returns the person index (h, w) at each pixel of the last reduced image, -1 without a person."""
        return self._owner

    @property
    def posture(self) -> Posture | None:
        """Returns the first performer's posture in the last frame, before smoothing.

        Returns None without a performer.
        """
        performers = self.performers
        return performers[0].follower.posture if performers else None

    def surfaces(self) -> dict[int, ObservedPoints]:
        """Returns the surface points of each performer in the last frame, by id.

        They are mirrored if the bodies are.
        """
        if self._view is None or self._owner is None or not self._by_depth:
            return {}
        surfaces = collect_visible_surfaces(self._view, self._owner, self._people.segment_ids())
        if self.settings.output.mirror:
            return mirror_surfaces(surfaces, *mirror_plane(self.world_from_camera))
        return surfaces

    def lock(self, ids: Iterable[int] | None = None) -> None:
        """Admits only these ids, or all people who are tracked now, as performers. All others are
        bystanders.

        Raises:
            InputError: if the sensor tracks people itself.
        """
        self._require_depth()
        self._people.track_manager.lock_to(ids)

    @property
    def is_locked(self) -> bool:
        """Returns True if new people are bystanders."""
        return self._people.track_manager.lock.is_closed

    @property
    def locked_ids(self) -> frozenset[int] | None:
        """Returns the ids that are admitted as performers. Returns None without a lock, because all people
        may then perform.
        """
        return self._people.track_manager.lock.ids

    def unlock(self) -> None:
        """Admits all people as performers again. Raises InputError like :meth:`lock`."""
        self._require_depth()
        self._people.track_manager.lock.open()

    def learn_room(self) -> None:
        """Learns the background and the floor again, starting with the next frame.

        People are searched again, and keep their ids if they are recognised.

        Raises:
            InputError: if the sensor tracks people itself.
        """
        if not self._by_depth:
            raise InputError(
                "the sensor tracks people itself, so the edge learns no room",
                where="edge",
                remedy="Restart the program that tracks the people.",
            )
        self._learns_again = True
        self._mounting.search_floor_again()

    def _require_depth(self) -> None:
        """Raises InputError if the sensor sends no depth but bodies that it tracked itself."""
        if not self._by_depth:
            raise InputError(
                "only the performers of one depth sensor can be locked",
                where="edge",
                remedy="Limit the tracked area instead: set zone under [tracker.scene] in the settings.",
            )

    def forget(self) -> None:
        """Drops all tracked and remembered people. The background model and the sensor's pose stay."""
        self._people.forget()
        self.output.forget()

    def track(self, frame: Frame) -> list[Body]:
        """Returns the bodies in a frame in world coordinates, tracked from its depth or by the sensor itself.

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
        if self._mounting.is_moving:
            self._view = None
            return []
        self._fitter.has_floor = self._mounting.is_height_known
        if not self._mounting.is_height_known and not self._people.people:
            view = self._mounting.raise_guess(view, self._guessed_floor.correct_before_search(view, room))
        scene = self.settings.scene
        kind = room.classify(view, scene.near, scene.far, scene.floor_band)
        segments = self._people.follow(view, kind)
        hold = self._people.finder.find(view, kind, segments, room, believe=not self._mounting.may_be_moving)
        if not self._mounting.is_height_known:
            view = self._raise_world(view)
        self._owner, self._view = segments.owner, view
        room.guard(segments.owner, self._people.find_moved_ids(), view.z)
        people = (segments.owner >= 0) | self._people.finder.find_searched_pixels(view)
        agreement = room.learn(view.z, people, view.time_ns, hold)
        self._remove_learnt_people(room, view)
        self._absorb_furniture(room, view, kind)
        self._mounting.detect_movement(view, agreement, people)
        return self._bodies(frame)

    def _raise_world(self, view: FrameView) -> FrameView:
        """Corrects the guessed floor by the people's soles.

        The people stay at the same place in the image.
        """
        step = self._guessed_floor.correct_after_fit(self._people.people)
        for person in self._people.people:
            person.raise_by(step)
        return self._mounting.raise_guess(view, step)

    def _remove_learnt_people(self, background: BackgroundModel, view: FrameView) -> None:
        """Removes parts of people from the background model. It may have learnt them in the first frames.

        An example is a leg below a hole in the depth.
        """
        people = [p.follower.posture for p in self._people.people if not p.has_moved]
        if people and background.age < _YOUNG_AGE_S:
            background.forget(
                pixels_near_bodies(view, people, self.settings.scene.floor_band, _SURFACE_DISTANCE_M)
            )

    def _absorb_furniture(self, background: BackgroundModel, view: FrameView, kind: UInt8) -> None:
        """Adds furniture next to people to the background model: pixels that touch people and never move.
        Such furniture was already there when the people were first detected.
        """
        people = [p.follower.posture for p in self._people.people]
        if people and self._owner is not None and round(background.age * _FURNITURE_RATE_HZ) != self._gave_up:
            self._gave_up = round(background.age * _FURNITURE_RATE_HZ)
            floor = self.settings.scene.floor_band
            is_still = background.still_pixels(view.z) & (kind == UNSEEN)
            background.absorb(find_furniture(view, is_still, self._owner, people, floor))

    def _background_for(self, view: FrameView) -> BackgroundModel:
        """Returns the background model, or a new one.

        A new one is created if the sensor was moved or exchanged, or after :meth:`learn_room`.
        """
        mounting, learns_again = self._mounting, self._learns_again
        self._learns_again = False
        is_far = mounting.has_new_pose and mounting.needs_people_search
        if mounting.is_new_camera or mounting.has_new_floor or is_far:
            self._people.sensor_moved(view.time_ns)
        elif learns_again:
            self._people.search_again(view.time_ns)
        if self._room is None or mounting.is_new_camera or mounting.has_new_pose or learns_again:
            self._room = BackgroundModel(view.z.shape, self.settings.room)
        return self._room

    def _limit_confidence(self, sure: Float, age_ns: int) -> Float:
        """Returns the confidence (20,) of a person's joints, with limits.

        The confidence is limited while the person is new. Legs are also limited while the floor is unknown.

        Args:
            sure: (20,) the confidence from the fit.
            age_ns: nanoseconds since the person was found.
        """
        ramp = min(max(age_ns / _CONFIDENCE_RAMP_NS, 0.0), 1.0)
        if ramp == 1.0 and self._mounting.is_floor_known:
            return sure
        legs = 1.0 if self._mounting.is_floor_known else _MAX_LEG_CONFIDENCE
        max_confidence = np.minimum(
            _FIRST_CONFIDENCE + (1.0 - _FIRST_CONFIDENCE) * ramp, np.where(_IS_LEG, legs, 1.0)
        )
        return np.minimum(sure, max_confidence)

    def _bodies(self, frame: DepthFrame) -> list[Body]:
        """Returns the output bodies: each performer's fit after smoothing, prediction and mirroring."""
        fits = []
        for person in self.performers:
            posture, confidence = person.follower.posture, person.follower.confidence
            age = frame.time_ns - person.found_ns if person.is_confirmed else 0
            confidence = self._limit_confidence(confidence, age)
            orientations, stature = posture.orientations(), person.measurements.stature
            fits.append(Body(person.id, posture.joints(), confidence, orientations, stature=stature))
        if self.colour is not None and self.world_from_camera is not None:
            fits = self.colour.improve(fits, frame, self.world_from_camera)
        return self.output(fits, frame.time_ns, self.world_from_camera)
