"""Scans an object that is picked up, turned and put down during the scan. Room and object have separate
poses.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven.meshes import Mesh
from enliven.scanning.ground_plane import cut_out, cut_whole_part, find_focus, find_ground
from enliven.scanning.loop_closure.history import FrameHistory
from enliven.scanning.objects.follower import ObjectFollower
from enliven.scanning.objects.joining import merge_rests
from enliven.scanning.objects.moved_step import MovedStep, ObjectState
from enliven.scanning.objects.object_model import ObjectModel
from enliven.scanning.objects.registration import ScannedSurface, register_part
from enliven.scanning.objects.rest import ObjectRest, merge_known_surfaces
from enliven.scanning.rigid import invert_pose
from enliven.scanning.scanner import ExcludedPixels, Scanner, ScanState, ScanStep
from enliven.scanning.settings import ScanSettings

_MAX_MISSED_IMAGES = 15
"""Number of consecutive images without the object after which it is searched at rest."""
MIN_REST_IMAGES = 10
"""Number of images of a new rest before the object is first searched in it."""
_MIN_RESTING_FRACTION = 0.8
"""Minimum fraction of points on the surface in an image that shows the object at rest again."""

_SEARCH_GROWTH = 1.6
"""Growth factor of the number of images of a rest after which a search for the object is repeated. Each
search takes as long as twenty images."""
_BAD_IMAGES_TO_END = 2
"""Number of successive badly fitting images that end a settling attempt, because one image may be blurred
by motion."""
_MAX_SIZE_RATIO = 1.5
"""Maximum ratio of a part's size to the size of the known object. A larger part is something else, such as a
wall or a person."""
_MAX_VOXEL_M = 0.004
"""Maximum voxel size, metres, for tracking an object. The coarsest volume has voxels 16 times as large. With
larger voxels, the known surface of an object half a metre high would be too coarse to find it again."""
_MAX_UNKNOWN_IMAGES = 10
"""Maximum number of images before the object is segmented. The object may be turned one second after the
first image."""


def object_tracking_settings(settings: ScanSettings) -> ScanSettings:
    """Returns the settings for tracking an object while it moves. Voxels are at most 4 mm wide."""
    volume = replace(settings.volume, voxel=min(settings.volume.voxel, _MAX_VOXEL_M))
    moved_settings = replace(
        settings.moved, followed=True, known_after=min(settings.moved.known_after, _MAX_UNKNOWN_IMAGES)
    )
    return replace(settings, volume=volume, moved=moved_settings)


class MovedScanner:
    """A scanner for an object that is moved during the scan, and the room around it.

    A rest is a period in which the object does not move. The settings choose the object among those on the
    floor. During a rest, room and object form one scan, and both constrain the camera's pose. If a part then
    moves rigidly relative to the floor, this part is the object, and the rest ends. Nothing is fused while
    the object is carried. When the scene stands still again, a new scan begins, and the object is searched in
    it in all rotations. If images saw through the object at a candidate pose, this counts against the pose.
    At the end, the object is cut out of every rest, and all their images are fused into one surface.

    Attributes:
        rests: the rests with a known object pose, in the order of time.
        unplaced: scans of a still scene in which the object was not found.
        model: the object's surface as it grows; None until it is first moved.
    """

    def __init__(self, settings: ScanSettings | None = None) -> None:
        self.settings = settings or ScanSettings()
        first = ObjectRest(self.settings, self.settings.cut_out.number)
        first.object_from_room = np.eye(4)
        self._now: ObjectRest | None = first
        self.rests: list[ObjectRest] = [first]
        self.unplaced: list[ObjectRest] = []
        self._trial: ObjectRest | None = None
        self._search, self._doubts, self._sought = 0.0, 0, 0
        self._known: tuple[int, ScannedSurface] | None = None
        self.model: ObjectModel | None = None
        self.followers: list[ObjectFollower] = []
        self._follower: ObjectFollower | None = None
        self._room: ObjectRest | None = None

    @property
    def megabytes(self) -> float:
        """Memory of the scans of all rests, in megabytes."""
        trial = [] if self._trial is None else [self._trial]
        model = 0.0 if self.model is None else self.model.megabytes
        model += sum(follower.history.megabytes for follower in self.followers)
        return model + sum(rest.scanner.megabytes for rest in [*self.rests, *self.unplaced, *trial])

    def add(self, frame: DepthFrame, up: Float | None = None) -> MovedStep:
        """Tracks the camera and the object in a frame, and fuses the image if both poses are reliable.

        Args:
            up: (3,) unit vector, camera frame, that points up, or None; see :meth:`Scanner.add`.
        """
        rest = self._now
        if self._follower is not None:
            followed = self._follow_object(frame, up)
            if followed is not None:
                return followed
        if rest is not None:
            step = rest.scanner.add(frame, up, self._find_doubtful_pixels(rest, frame))
            if step.state is not ScanState.LOST:
                if not rest.has_moved(step):
                    self._trial = None
                    rest.look_again()
                    self._fuse_into_model(rest, step)
                    return self._step_result(step, ObjectState.RESTING, rest)
                self._end_rest(rest)
                if self.settings.moved.followed and self._begin_tracking(rest, step):
                    return self._step_result(step, ObjectState.LOST, None)
        return self._try_resting(frame, up)

    def _find_doubtful_pixels(self, rest: ObjectRest, frame: DepthFrame) -> ExcludedPixels | None:
        """Returns the pixels of the object. It may begin to move, so the camera tracking may have to ignore
        them.
        """
        if not self.settings.moved.followed or rest.ground is None:
            return None
        return ExcludedPixels(
            doubtful=rest.object_pixels(rest.scanner.prepare_view(frame), rest.scanner.predicted_pose)
        )

    def _begin_tracking(self, rest: ObjectRest, step: ScanStep) -> bool:
        """Starts tracking the object from its last rest pose. Returns True if that pose is known."""
        view = rest.scanner.view
        if self.model is None or rest.object_from_room is None or view is None:
            return False
        pose = rest.object_from_room @ step.world_from_camera
        self._room = rest
        self._follower = ObjectFollower(self.model, rest, pose, self.settings)
        self.followers.append(self._follower)
        return True

    def _follow_object(self, frame: DepthFrame, up: Float | None) -> MovedStep | None:
        """Tracks object and room separately in an image. Returns None if the object was lost for too long."""
        follower, room = self._follower, self._room
        assert follower is not None and room is not None
        view = room.scanner.prepare_view(frame)
        followed = follower.find(view, room.scanner.predicted_pose)
        step = room.scanner.add(frame, up, ExcludedPixels(followed.object_points))
        follower.update(frame, view, followed, step.world_from_camera)
        if follower.missed > _MAX_MISSED_IMAGES:
            self._follower = None
            return None
        pose = followed.object_from_camera @ invert_pose(step.world_from_camera)
        state = ObjectState.FOLLOWED if followed.sure else ObjectState.LOST
        return MovedStep(step, state, pose if followed.sure else None, len(self.rests), followed=followed)

    def close_loops(self) -> None:
        """Closes the loops of the camera's trajectory at each rest, as :meth:`Scanner.close_loops` does."""
        for rest in self.rests:
            rest.scanner.close_loops()

    @property
    def place(self) -> tuple[Scanner, Float] | None:
        """The scan of the room and (4, 4) the object's current pose in it; None while the pose is unknown."""
        if self._follower is not None and self._room is not None:
            if self._follower.missed:
                return None
            room = self._room.scanner
            return room, np.asarray(self._follower.pose @ invert_pose(room.pose))
        if self._now is None or self._now.object_from_room is None:
            return None
        return self._now.scanner, self._now.object_from_room

    @property
    def now(self) -> ObjectRest | None:
        """The current rest of the object, or None while the object's pose is unknown."""
        return self._now

    @property
    def history(self) -> FrameHistory:
        """The stored images of the first rest."""
        return self.rests[0].scanner.history

    @property
    def poses(self) -> list[tuple[int, Float]]:
        """Pairs of a time in nanoseconds and the camera's pose (4, 4), for the images of the first rest."""
        return self.rests[0].scanner.poses

    @property
    def is_full(self) -> bool:
        """True if the memory for voxels is full."""
        is_model_full = self.model is not None and self.model.is_full
        return is_model_full or any(rest.scanner.is_full for rest in self.rests)

    def extract_surface(self, since: int = 0) -> Mesh:
        """Returns the surface of the first room with the object in it, as :meth:`Scanner.surface` does."""
        return self.rests[0].scanner.extract_surface(since)

    def extract_object(self) -> Mesh:
        """Returns the mesh of the object, merged from all rests: in its pose at the first rest, upright, on y
        = 0, metres.

        Raises:
            InputError: if no object stands on a floor.
        """
        first_rest, surface = self.rests[0], self.extract_surface()
        ground = find_ground(surface)
        self._relocate_in_all_rests()
        if len(self.rests) == 1 and not self.followed_images:
            focus = find_focus([pose for _, pose in first_rest.scanner.poses])
            return cut_out(surface, ground, focus, self.settings.cut_out)
        mesh = self.merge_surfaces()
        if not len(mesh.faces):
            advice = "Let the object stand still for a second before you turn it, and turn it more slowly."
            raise InputError(
                "the object moved all the time and could not be tracked", where="scan", remedy=advice
            )
        return cut_whole_part(mesh, ground, self.settings.cut_out)

    def merge_surfaces(self) -> Mesh:
        """Returns the surface of the object, merged from all rests, metres, in the world of the first
        rest.
        """
        self._relocate_in_all_rests()
        for rest in self.rests:
            rest.search_objects(0)
        return merge_rests(self.rests, self.settings, self.followers)

    @property
    def followed_images(self) -> int:
        """The number of images in which the object was tracked while it moved."""
        return sum(len(follower.poses) for follower in self.followers)

    def _try_resting(self, frame: DepthFrame, up: Float | None) -> MovedStep:
        """Fuses a frame of a scene that may stand still again, and searches for the object in it."""
        trial, s = self._trial, self.settings.moved
        if trial is None:
            trial = self._trial = ObjectRest(self.settings)
            self._search, self._doubts, self._sought = float(MIN_REST_IMAGES), 0, 0
        step = trial.scanner.add(frame, up)
        fits = step.alignment is None or step.alignment.agreeing >= _MIN_RESTING_FRACTION
        self._doubts = 0 if fits and step.state is not ScanState.LOST else self._doubts + 1
        if self._doubts >= _BAD_IMAGES_TO_END or trial.has_moved(step):
            if trial.count >= s.known_after:
                trial.end()
                self.unplaced.append(trial)
            self._trial = None
            return self._step_result(step, ObjectState.LOST, None)
        if trial.count >= self._search:
            self._search *= _SEARCH_GROWTH
            if self._place_rest(trial):
                if self._now is not None:
                    self._end_rest(self._now)
                self._now, self._trial = trial, None
                if self.model is not None:
                    self.model.fuse_rest(trial)
                return self._step_result(step, ObjectState.RESTING, trial)
            self._sought += 1
        return self._step_result(step, ObjectState.SETTLING, None)

    def _end_rest(self, rest: ObjectRest) -> None:
        """Ends a rest. After the first rest, the object's own model is created."""
        rest.end()
        self._now = None
        if self.model is None:
            self.model = ObjectModel(self.settings)
            if self.settings.moved.followed and not rest.has_stood_still():
                self.model.begin(rest)
            else:
                rest.search_objects(0)
                self.model.fuse_rest(rest)

    def _fuse_into_model(self, rest: ObjectRest, step: ScanStep) -> None:
        """Fuses an image into the object's own model."""
        view = rest.scanner.view
        if self.model is not None and view is not None and step.state is ScanState.SCANNING:
            self.model.add(view, rest, step.world_from_camera)

    def _relocate_in_all_rests(self) -> None:
        """Searches for the object again in all rests in which it was not found. The search may succeed now
        because more of the surface is known.
        """
        if self._trial is not None and self._trial.count >= self.settings.moved.known_after:
            self.unplaced.append(self._trial)
        self._trial = None
        for rest in self.unplaced[:]:
            if self._place_rest(rest):
                self.unplaced.remove(rest)
                if self.model is not None:
                    self.model.fuse_rest(rest)

    def _place_rest(self, rest: ObjectRest) -> bool:
        """Searches for the object in a rest. Returns True if it was found."""
        rest.search_objects(0)
        model = self._make_scanned_object() if rest.parts else None
        if model is None:
            return False
        size = np.linalg.norm(np.ptp(model.surface.points, axis=0))
        for number, part in enumerate(rest.parts):
            if np.linalg.norm(np.ptp(part.bounds, axis=0)) > _MAX_SIZE_RATIO * size:
                continue
            registration = register_part(model, rest.find_scanned_surface(number))
            if registration is not None:
                rest.object_from_room = registration.model_from_part
                rest.choose_part(number)
                self.rests.append(rest)
                return True
        return False

    def _make_scanned_object(self) -> ScannedSurface | None:
        """Returns the known surface of the object from all rests in which it was found; None if no surface is
        known.
        """
        if self._known is None or self._known[0] != len(self.rests):
            scanned = merge_known_surfaces(self.rests)
            if scanned is None:
                return None
            self._known = len(self.rests), scanned
        return self._known[1]

    def _step_result(self, step: ScanStep, state: ObjectState, rest: ObjectRest | None) -> MovedStep:
        """Returns the result of a frame, with the pose of the object in the room."""
        pose = None if rest is None else rest.object_from_room
        sought = self._sought if state is ObjectState.SETTLING else 0
        return MovedStep(step, state, pose, len(self.rests), sought)
