"""The room with an object at one place: a scan of its own, while floor and object do not move apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import Bool, Float
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.scanning.depth_view import DepthView, only
from enliven.scanning.ground import Ground, find_ground, focus_of, parts_about
from enliven.scanning.marching_cubes import surface_of
from enliven.scanning.objects.floor import floor_plane
from enliven.scanning.objects.free_space import SeenDepth, seen_depth
from enliven.scanning.objects.region import ObjectRegion, region_about, shown_in
from enliven.scanning.objects.registration import Scanned
from enliven.scanning.objects.surface_points import SurfacePoints, sampled
from enliven.scanning.objects.vacated import share_vacated
from enliven.scanning.scanner import Scanner, ScanState, ScanStep
from enliven.scanning.settings import ScanSettings

_ABOUT = 0.04
"""Metres about an object's surface in which an image's points are compared with it: voxels are 16 mm wide."""
_OWN = 0.02
"""Metres about an object's surface in which an image's points are its own: what the tracking may be off."""
_TWICE = 2
"""Images one after the other in which object and floor must be apart: one may be wrong."""
_HANDS_ON = 15
"""Images before an object is seen to move that are not of it at rest: hands were on it already."""
_PARTS = 3
"""Things about the focus that are looked at, where it is not known which is the object."""
_POINTS = 6000
"""Points of a surface by which it is found: a few for each square centimetre of a chair's."""
_FIRST = 5
"""Images that tell where the floor is, each time that it was looked for."""
_VIEWS = 16
"""Images of a rest that tell how far they saw."""
_CLEAR = 1.25
"""Coarse voxels by which a point must lie before what is seen: their surfaces are half a voxel off."""
_VACATED = 0.08
"""Share of a thing's points, of those in view, that are seen through, from which on it has moved."""
_LOOKS = 7
"""Images of a rest that tell whether the object stood still in it."""
_FEW = 2000
"""Points of each thing that are looked for in each image: 0.3 ms."""
_FOLLOWS = 0.5
"""Share of an object's points in known space that lie at its surface, below which it has moved."""


class ObjectRest:
    """A scan of the room with the object at one place.

    Args:
        choice: number of the thing on the floor that is the object, 1 for the one that is looked at most.

    Attributes:
        object_from_room: (4, 4) how the object lies there, or None while that is not known.
        ground: what it stands on, parts: what stands on it, the object first; as they were last looked for.
        images: of the scan that show it at rest, once it ended.
    """

    def __init__(self, settings: ScanSettings, choice: int = 1) -> None:
        self.settings = settings
        self.scanner = Scanner(settings)
        self.object_from_room: Float | None = None
        self.ground: Ground | None = None
        self.parts: list[Mesh] = []
        self.images: int | None = None
        self._choice = choice
        self._region: ObjectRegion | None = None
        self._middle: Float | None = None
        self._floors: list[Float] = []
        self._next = settings.moved.known_after
        self._apart = 0
        self._stood: list[Float] = []
        self._scanned: tuple[int, Scanned] | None = None

    @property
    def count(self) -> int:
        """Images that were fused."""
        return len(self.scanner.poses)

    def look_again(self) -> None:
        """Finds the ground and the object, where enough more images show them than the last time."""
        if self.count >= self._next:
            self._next = 2 * self.count
            self.look()

    def look(self, level: int = 1) -> None:
        """Finds the ground and what stands on it, in one of the volumes."""
        mesh, cut = surface_of(self.scanner.volumes[level]), self.settings.cut_out
        try:
            ground = find_ground(mesh, settings=cut)
        except InputError:
            return
        focus = focus_of([pose for _, pose in self.scanner.poses])
        parts = parts_about(mesh, ground, focus, cut)
        if len(parts) < self._choice:
            return
        self.ground, self.parts = ground, parts[: max(_PARTS, self._choice)]
        self._stood = [sampled(part, _FEW).points for part in self.parts]
        number = self._choice - 1
        if self._middle is not None:
            number = int(np.argmin([np.linalg.norm(part.bounds.mean(0) - self._middle) for part in parts]))
        self.mean(number)

    def mean(self, number: int) -> None:
        """Takes one of the parts for the object."""
        if self.ground is not None:
            part = self.parts.pop(number)
            self.parts.insert(0, part)
            self._stood.insert(0, self._stood.pop(number))
            self._region = region_about(part, self.ground, self.settings.cut_out.clearance, _ABOUT)
            self._middle = np.mean(part.bounds, axis=0)
            self._floors = []

    def held(self, view: DepthView, room_from_camera: Float) -> Bool:
        """Returns (h, w) which points lie where the object stands at rest."""
        if self._region is None:
            return np.zeros(view.worth.shape, bool)
        return shown_in(self._region, view, room_from_camera)

    def moved(self, step: ScanStep) -> bool:
        """Returns whether floor and object were seen to be apart, in the last image and in the one before."""
        view, pose = self.scanner.view, step.world_from_camera
        s = self.settings.moved
        # Where the room is too plain to be sure of the camera, its place is still about right.
        seen = (ScanState.SCANNING, ScanState.UNSURE) if s.followed else (ScanState.SCANNING,)
        if step.state not in seen or view is None:
            return False
        if self.ground is None or self._region is None or self._middle is None:
            return False
        own = shown_in(self._region, view, pose)
        floor, apart = floor_plane(view, pose, self.ground, self._middle, own), False
        if floor is not None and len(self._floors) < _FIRST:
            # The ground was found in coarse voxels; what counts is how images see it.
            self._floors.append(floor)
        elif floor is not None:
            gap = floor - np.median(self._floors, axis=0)
            apart = bool(abs(gap[0]) > s.lifted or np.hypot(gap[1], gap[2]) > s.tilted)
        fit = self.scanner.tracker.judged(only(view, own), pose)
        apart = apart or (fit.overlap > self.settings.tracking.overlap and fit.agreeing < _FOLLOWS)
        apart = apart or (s.followed and self._left(view, pose))
        self._apart = self._apart + 1 if apart else 0
        return self._apart >= _TWICE

    def _left(self, view: DepthView, pose: Float) -> bool:
        """Returns whether one of the parts is not all where it stood; from then on that one is the object."""
        shares = [share_vacated(points, view, pose, self._clear) for points in self._stood]
        if not shares or max(shares) < _VACATED:
            return False
        number = int(np.argmax(shares))
        if number:
            self.mean(number)
        return True

    def stood_still(self) -> bool:
        """Returns whether the images until its end show the object at one place, not turning."""
        numbers = self.numbers
        if not self._stood or not numbers:
            return False
        points = self._stood[0]
        some = numbers[:: max(len(numbers) // _LOOKS, 1)]
        found = [
            share_vacated(points, self.scanner.prepared(frame), self.scanner.poses[number][1], self._clear)
            for number, frame in self.scanner.history.frames(some)
        ]
        return float(np.median(found)) < _VACATED

    @property
    def _clear(self) -> float:
        """Metres by which what stood there must lie before what is seen, to be gone."""
        return _CLEAR * self.scanner.volumes[1].band.voxel

    def end(self) -> None:
        """Ends the rest; hands were on the object in its last images."""
        self.images = max(self.count - _HANDS_ON, 1)

    @property
    def numbers(self) -> list[int]:
        """The numbers of the images that are still there and show it at rest."""
        last = self.count if self.images is None else self.images
        return [number for number in self.scanner.history.numbers if number < last]

    def views(self, numbers: list[int]) -> Iterator[tuple[DepthView, Float]]:
        """Yields images, of which only the object's points make a surface; and (4, 4) room_from_camera."""
        if self.ground is None or not self.parts:
            return
        region = region_about(self.parts[0], self.ground, self.settings.cut_out.clearance, _OWN)
        for number, frame in self.scanner.history.frames(numbers):
            view, pose = self.scanner.prepared(frame), self.scanner.poses[number][1]
            yield only(view, shown_in(region, view, pose)), pose

    def scanned(self, number: int = 0) -> Scanned:
        """Returns points of a part, and how far some of the images saw, in the room's world."""
        if self._scanned is None or self._scanned[0] != self.count:
            numbers = self.scanner.history.numbers
            chosen = numbers[:: max(len(numbers) // _VIEWS, 1)]
            found = self.scanner.history.frames(chosen)
            views = [seen_depth(self.scanner.prepared(f), self.scanner.poses[n][1]) for n, f in found]
            self._scanned = self.count, Scanned(sampled(self.parts[0], _POINTS), views)
        if not number:
            return self._scanned[1]
        return Scanned(sampled(self.parts[number], _POINTS), self._scanned[1].views)


def known_of(rests: Sequence[ObjectRest]) -> Scanned | None:
    """Returns what all rests know of an object, in its own frame; None where none of them shows it."""
    points, normals, views = list[Float](), list[Float](), list[SeenDepth]()
    for rest in rests:
        rest.look(0)
        pose = rest.object_from_room
        if pose is None or not rest.parts:
            continue
        own = rest.scanned()
        moved = own.surface.moved(pose)
        points.append(moved.points)
        normals.append(moved.normals)
        views += [replace(v, frame_from_camera=pose @ v.frame_from_camera) for v in own.views]
    if not points:
        return None
    return Scanned(SurfacePoints(np.concatenate(points), np.concatenate(normals)), views)
