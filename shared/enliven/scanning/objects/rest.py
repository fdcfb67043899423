"""A rest: a separate scan of the room while the object stays at one place and does not move relative to the
floor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import Bool, Float
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.scanning.depth_view import DepthView, restrict_view
from enliven.scanning.ground_plane import GroundPlane, find_focus, find_ground, find_parts
from enliven.scanning.marching_cubes import extract_surface
from enliven.scanning.objects.floor import floor_plane
from enliven.scanning.objects.free_space import SeenDepth, seen_depth
from enliven.scanning.objects.region import ObjectRegion, create_region, points_in_region
from enliven.scanning.objects.registration import ScannedSurface
from enliven.scanning.objects.surface_points import SurfacePoints, sample_surface
from enliven.scanning.objects.vacated import compute_vacated_fraction
from enliven.scanning.scanner import Scanner, ScanState, ScanStep
from enliven.scanning.settings import MIN_OVERLAP_FRACTION, ScanSettings

MIN_MOVED_DISTANCE_M = 0.015
"""Maximum displacement of the object relative to the floor. Above it, the object counts as moved."""
MIN_MOVED_ANGLE_RAD = 0.015
"""Maximum rotation of the object relative to the floor. Above it, the object counts as moved."""

_COMPARISON_DISTANCE_M = 0.04
"""Image points within this distance of an object's surface, metres, are compared with it. The voxels used are
16 mm wide."""
_OBJECT_DISTANCE_M = 0.02
"""Image points within this distance of an object's surface, metres, belong to it. It allows for the tracking
error."""
_APART_IMAGES = 2
"""Number of successive images in which the object must have moved relative to the floor, because one image
may be wrong."""
_EXCLUDED_IMAGES = 15
"""Number of images before a detected motion that are excluded from the rest, because hands already touch the
object in them."""
_MAX_PARTS = 3
"""Number of parts near the focus that are considered while it is not known which one is the object."""
_REGISTRATION_POINTS = 6000
"""Number of surface points for registration: a few per square centimetre of a chair."""
_FLOOR_IMAGES = 5
"""Number of images that establish the floor's position after each search for it."""
_FREE_SPACE_VIEWS = 16
"""Number of images of a rest that are kept as free space observations."""
_MIN_CLEARANCE_VOXELS = 1.25
"""Minimum distance, in coarse voxels, in front of the observed depth at which a point counts as seen through.
Coarse surfaces have an error of half a voxel."""
_MIN_VACATED_FRACTION = 0.08
"""An object counts as moved if at least this fraction of its visible points is seen through."""
_CHECKED_IMAGES = 7
"""Number of images of a rest that are tested to decide whether the object stood still."""
_TESTED_POINTS = 2000
"""Number of points of each part that are tested in each image. The test of an image takes 0.3 ms."""
_MIN_SURFACE_FRACTION = 0.5
"""Minimum fraction of an object's points in known space that lie at its surface. Below it, the object has
moved."""


class ObjectRest:
    """A scan of the room with the object at one place.

    Args:
        choice: number of the object among those on the floor. 1 is the object that the camera looks at most.

    Attributes:
        object_from_room: (4, 4) the object's pose, or None while it is unknown.
        ground: the plane that the object stands on, from the last search.
        parts: the objects on the ground, the chosen object first, from the last search.
        images: number of the scan's images that show the object at rest, known once the rest has ended.
    """

    def __init__(self, settings: ScanSettings, choice: int = 1) -> None:
        self.settings = settings
        self.scanner = Scanner(settings)
        self.object_from_room: Float | None = None
        self.ground: GroundPlane | None = None
        self.parts: list[Mesh] = []
        self.images: int | None = None
        self._choice = choice
        self._region: ObjectRegion | None = None
        self._middle: Float | None = None
        self._floors: list[Float] = []
        self._next = settings.moved.known_after
        self._apart = 0
        self._stood: list[Float] = []
        self._scanned: tuple[int, ScannedSurface] | None = None

    @property
    def count(self) -> int:
        """Number of images that were fused."""
        return len(self.scanner.poses)

    def look_again(self) -> None:
        """Searches for the ground and the object again if the number of images has grown enough since the
        last search.
        """
        if self.count >= self._next:
            self._next = 2 * self.count
            self.search_objects()

    def search_objects(self, level: int = 1) -> None:
        """Searches for the ground and the objects on it in the volume with the given number."""
        mesh, cut = extract_surface(self.scanner.volumes[level]), self.settings.cut_out
        try:
            ground = find_ground(mesh)
        except InputError:
            return
        focus = find_focus([pose for _, pose in self.scanner.poses])
        parts = find_parts(mesh, ground, focus, cut)
        if len(parts) < self._choice:
            return
        self.ground, self.parts = ground, parts[: max(_MAX_PARTS, self._choice)]
        self._stood = [sample_surface(part, _TESTED_POINTS).points for part in self.parts]
        number = self._choice - 1
        if self._middle is not None:
            number = int(np.argmin([np.linalg.norm(part.bounds.mean(0) - self._middle) for part in parts]))
        self.choose_part(number)

    def choose_part(self, number: int) -> None:
        """Chooses one of the parts as the object."""
        if self.ground is not None:
            part = self.parts.pop(number)
            self.parts.insert(0, part)
            self._stood.insert(0, self._stood.pop(number))
            self._region = create_region(
                part, self.ground, self.settings.cut_out.clearance, _COMPARISON_DISTANCE_M
            )
            self._middle = np.mean(part.bounds, axis=0)
            self._floors = []

    def object_pixels(self, view: DepthView, room_from_camera: Float) -> Bool:
        """Returns (h, w) True for each point in the object's region at rest."""
        if self._region is None:
            return np.zeros(view.worth.shape, bool)
        return points_in_region(self._region, view, room_from_camera)

    def has_moved(self, step: ScanStep) -> bool:
        """Returns True if the object had moved relative to the floor in the last two images."""
        view, pose = self.scanner.view, step.world_from_camera
        s = self.settings.moved
        # Use uncertain camera poses too. Even if the room has too little structure for a certain pose, the
        # pose is approximately right.
        usable_states = (ScanState.SCANNING, ScanState.UNSURE) if s.followed else (ScanState.SCANNING,)
        if step.state not in usable_states or view is None:
            return False
        if self.ground is None or self._region is None or self._middle is None:
            return False
        object_pixels = points_in_region(self._region, view, pose)
        floor, is_apart = floor_plane(view, pose, self.ground, self._middle, object_pixels), False
        if floor is not None and len(self._floors) < _FLOOR_IMAGES:
            # The ground plane is imprecise, because it was found in coarse voxels. So measure the reference
            # height of the floor in the first images.
            self._floors.append(floor)
        elif floor is not None:
            floor_change = floor - np.median(self._floors, axis=0)
            is_apart = bool(
                abs(floor_change[0]) > MIN_MOVED_DISTANCE_M
                or np.hypot(floor_change[1], floor_change[2]) > MIN_MOVED_ANGLE_RAD
            )
        fit = self.scanner.tracker.evaluate(restrict_view(view, object_pixels), pose)
        is_apart = is_apart or (fit.overlap > MIN_OVERLAP_FRACTION and fit.agreeing < _MIN_SURFACE_FRACTION)
        is_apart = is_apart or (s.followed and self._has_left(view, pose))
        self._apart = self._apart + 1 if is_apart else 0
        return self._apart >= _APART_IMAGES

    def _has_left(self, view: DepthView, pose: Float) -> bool:
        """Returns True if at least a fraction of one part has moved away. That part then becomes the
        object."""
        seen_through_fractions = [
            compute_vacated_fraction(points, view, pose, self._clearance_m) for points in self._stood
        ]
        if not seen_through_fractions or max(seen_through_fractions) < _MIN_VACATED_FRACTION:
            return False
        number = int(np.argmax(seen_through_fractions))
        if number:
            self.choose_part(number)
        return True

    def has_stood_still(self) -> bool:
        """Returns True if the images until the end of the rest show the object at one place, without
        rotation.
        """
        numbers = self.numbers
        if not self._stood or not numbers:
            return False
        points = self._stood[0]
        checked_numbers = numbers[:: max(len(numbers) // _CHECKED_IMAGES, 1)]
        fractions = [
            compute_vacated_fraction(
                points, self.scanner.prepare_view(frame), self.scanner.poses[number][1], self._clearance_m
            )
            for number, frame in self.scanner.history.frames(checked_numbers)
        ]
        return float(np.median(fractions)) < _MIN_VACATED_FRACTION

    @property
    def _clearance_m(self) -> float:
        """Minimum distance, metres, from a former surface point to the observed depth behind it. From this
        distance on, the point counts as gone.
        """
        return _MIN_CLEARANCE_VOXELS * self.scanner.volumes[1].band.voxel

    def end(self) -> None:
        """Ends the rest and excludes its last images, in which hands touched the object."""
        self.images = max(self.count - _EXCLUDED_IMAGES, 1)

    @property
    def numbers(self) -> list[int]:
        """The numbers of the stored images that show the object at rest."""
        last = self.count if self.images is None else self.images
        return [number for number in self.scanner.history.numbers if number < last]

    def read_views(self, numbers: list[int]) -> Iterator[tuple[DepthView, Float]]:
        """Yields images restricted to the object's points, and their (4, 4) room_from_camera."""
        if self.ground is None or not self.parts:
            return
        region = create_region(
            self.parts[0], self.ground, self.settings.cut_out.clearance, _OBJECT_DISTANCE_M
        )
        for number, frame in self.scanner.history.frames(numbers):
            view, pose = self.scanner.prepare_view(frame), self.scanner.poses[number][1]
            yield restrict_view(view, points_in_region(region, view, pose)), pose

    def find_scanned_surface(self, number: int = 0) -> ScannedSurface:
        """Returns surface points of a part, and free-space observations from some of the images, in the world
        of the room.
        """
        if self._scanned is None or self._scanned[0] != self.count:
            numbers = self.scanner.history.numbers
            chosen = numbers[:: max(len(numbers) // _FREE_SPACE_VIEWS, 1)]
            frames = self.scanner.history.frames(chosen)
            views = [seen_depth(self.scanner.prepare_view(f), self.scanner.poses[n][1]) for n, f in frames]
            self._scanned = (
                self.count,
                ScannedSurface(sample_surface(self.parts[0], _REGISTRATION_POINTS), views),
            )
        if not number:
            return self._scanned[1]
        return ScannedSurface(
            sample_surface(self.parts[number], _REGISTRATION_POINTS), self._scanned[1].views
        )


def merge_known_surfaces(rests: Sequence[ObjectRest]) -> ScannedSurface | None:
    """Returns the surface of an object from all rests, in its own frame; None if no rest shows it."""
    points, normals, views = list[Float](), list[Float](), list[SeenDepth]()
    for rest in rests:
        rest.search_objects(0)
        pose = rest.object_from_room
        if pose is None or not rest.parts:
            continue
        surface = rest.find_scanned_surface()
        moved_points = surface.surface.transform(pose)
        points.append(moved_points.points)
        normals.append(moved_points.normals)
        views += [replace(v, frame_from_camera=pose @ v.frame_from_camera) for v in surface.views]
    if not points:
        return None
    return ScannedSurface(SurfacePoints(np.concatenate(points), np.concatenate(normals)), views)
