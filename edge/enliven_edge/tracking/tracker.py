"""The tracker: depth frames in, the people's joints out."""

from __future__ import annotations

from collections.abc import Iterable

from enliven.arrays import Float, Int
from enliven.deformation.constraints import Seen
from enliven.frames import DepthFrame
from enliven.person import Body
from enliven_edge.landmarks import ColourEye
from enliven_edge.tracking.body_model import Posture
from enliven_edge.tracking.fit import Fitter
from enliven_edge.tracking.frame import View
from enliven_edge.tracking.health import TrackerState
from enliven_edge.tracking.output import Output, mirror_of, mirrored_surfaces, seen_surfaces
from enliven_edge.tracking.people import MultiPersonTracker, Person
from enliven_edge.tracking.scene import Mounting, Room
from enliven_edge.tracking.segment import lying_on
from enliven_edge.tracking.settings import TrackerSettings

_YOUNG, _SURFACE = 1.0, 0.05
"""Seconds for which the room may have people in it, and metres from their surface within which it does."""


class Tracker:
    """People from depth alone.

    A frame goes: reduce, place in the world, take the room away, share the rest among the people, fit them,
    look for new ones, smooth.

    Args:
        colour: looks at the colour image too, where there is one; None: depth alone.
    """

    def __init__(self, settings: TrackerSettings | None = None, colour: ColourEye | None = None) -> None:
        self.settings = settings or TrackerSettings()
        self._mounting = Mounting(self.settings.scene, self.settings.room.moved)
        self._people = MultiPersonTracker(self.settings, Fitter(self.settings.fit))
        self._room: Room | None = None
        self._owner: Int | None = None
        self._view: View | None = None
        self.output = Output(self.settings)
        self.colour = colour

    @property
    def world_from_camera(self) -> Float | None:
        """(4, 4) where the sensor was found to stand; None before the first frame."""
        return self._mounting.world_from_camera

    @property
    def performers(self) -> list[Person]:
        """Who is followed and may perform, those who were found first come first."""
        return self._people.performers

    @property
    def bystanders(self) -> int:
        """How many people are in view who are no performers: out of the zone, or locked out."""
        return self._people.bystanders

    @property
    def state(self) -> TrackerState:
        """What the tracker knows of the last frame, for the monitor of its health."""
        age = self._room.age if self._room is not None else 0.0
        moved = self._mounting.falling or (self._mounting.new_place and not self._mounting.new_camera)
        return TrackerState(self._mounting.floor_known, age, moved)

    @property
    def owner(self) -> Int | None:
        """(h, w) whose each pixel of the reduced image was in the last frame: 0, 1, ...; -1 nobody's."""
        return self._owner

    @property
    def posture(self) -> Posture | None:
        """The first performer's posture in the last frame, before smoothing; None while nobody is tracked."""
        performers = self.performers
        return performers[0].follower.posture if performers else None

    def surfaces(self) -> dict[int, Seen]:
        """What the last frame shows of each performer's surface, by id; mirrored as the bodies are."""
        if self._view is None or self._owner is None:
            return {}
        found = seen_surfaces(self._view, self._owner, self._people.segment_ids())
        if self.settings.output.mirror:
            return mirrored_surfaces(found, *mirror_of(self.world_from_camera))
        return found

    def lock(self, ids: Iterable[int] | None = None) -> None:
        """Only these people, or all who are followed now, are performers; newcomers are bystanders."""
        self._people.lock_to(ids)

    @property
    def locked(self) -> bool:
        """Whether newcomers are bystanders."""
        return self._people.lock.ids is not None

    def unlock(self) -> None:
        """Newcomers may be performers again."""
        self._people.unlock()

    def forget(self) -> None:
        """Drops everybody who is followed or remembered; the room and the sensor's place stay."""
        self._people.forget()
        self.output.forget()

    def track(self, frame: DepthFrame) -> list[Body]:
        """The bodies in a frame, world frame; empty where nobody is seen."""
        view = self._mounting.view(frame, nobody=not self._people.people)
        room = self._room_of(view)
        if self._mounting.falling:
            self._view = None
            return []
        scene = self.settings.scene
        kind = room.classify(view, scene.near, scene.far, scene.floor_band)
        segments = self._people.follow(view, kind)
        hold = self._people.find_new(view, kind, segments, room, believe=not self._mounting.suspected)
        self._owner, self._view = segments.owner, view
        room.guard(segments.owner, self._people.travelled_ids(), view.z)
        somebody = (segments.owner >= 0) | self._people.searched_pixels(view)
        agreement = room.learn(view.z, somebody, view.time_ns, hold)
        self._take_back(room, view)
        self._mounting.watch(view, agreement, somebody)
        return self._bodies(frame)

    def _take_back(self, room: Room, view: View) -> None:
        """Who was there when the room was first seen may be taken for it in part: a leg below a hole."""
        people = [p.follower.posture for p in self._people.people if not p.travelled]
        if people and room.age < _YOUNG:
            room.forget(lying_on(view, people, self.settings.scene.floor_band, _SURFACE))

    def _room_of(self, view: View) -> Room:
        """The room, a new one where the sensor was moved or exchanged."""
        mounting = self._mounting
        if mounting.new_camera or (mounting.new_place and mounting.far_away):
            self._people.sensor_moved(view.time_ns)
        if self._room is None or mounting.new_camera or mounting.new_place:
            self._room = Room(view.z.shape, self.settings.room)
        return self._room

    def _bodies(self, frame: DepthFrame) -> list[Body]:
        """What leaves the tracker: every performer's fit, smoothed and more as the settings say."""
        fits = []
        for person in self.performers:
            posture, sure = person.follower.posture, person.follower.confidence
            turns, stature = posture.orientations(), person.looks.stature
            fits.append(Body(person.id, posture.joints(), sure, turns, stature=stature))
        if self.colour is not None and self.world_from_camera is not None:
            fits = self.colour.improve(fits, frame, self.world_from_camera)
        return self.output(fits, frame.time_ns, self.world_from_camera)
