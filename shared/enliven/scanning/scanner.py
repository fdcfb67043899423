"""A scan: frame by frame the camera is found and its image fused; what is not sure is not fused."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from enliven.arrays import Bool, Float
from enliven.camera import LEVEL_WORLD_FROM_CAMERA, Intrinsics
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven.meshes import Mesh
from enliven.rotation import nearest_rotation
from enliven.scanning.camera_tracker import Alignment, CameraTracker
from enliven.scanning.depth_view import DepthPreparation, DepthView, only
from enliven.scanning.ground import cut_out, find_ground, focus_of
from enliven.scanning.keyframes import Keyframes
from enliven.scanning.loops import ClosedWay, FrameHistory, closed_way
from enliven.scanning.marching_cubes import surface_of
from enliven.scanning.settings import ScanSettings, VolumeSettings
from enliven.scanning.threads import made_ahead
from enliven.scanning.volume import DistanceVolume

_COARSER = 4.0
"""Factor of the voxels from one volume to the next: each reaches four times as far from the surface."""
_LEVELS = 3
"""Volumes: 4, 16 and 64 mm, of which the last brings a camera back from 25 cm away."""
_TRIED = 4
"""Keyframes from which a lost camera is sought in each frame: 30 ms each."""
_CLEANED = 90
"""Frames after which blocks without a surface are given back: three seconds."""
_FRAME = 1.0 / 30.0
"""Seconds between two images at least, where a recording's times stand still."""
_MANY = 120
"""Images that are fused again at least. Of twice as many every second one is left out: so many average the
noise out, and the stage waits for them."""
_ROUGHLY = 3
"""Of very many images every third of those that are fused again goes into the coarse volumes, which only
lead a camera near; of few images all do, for each may show what no other does."""
_STAYED = 0.25
"""Voxels by which a closed way must move an image for all to be fused again: 1.3 mm bring leaves, which are
2 mm thick, a tenth nearer to the truth."""
_SURER = 0.5
"""Times the deviation that is let pass at most where an image left the camera's place open at first."""
_SLACK = 0.05
"""Metres that a camera may be found off at any time: twice what noise and a hand's tremor do."""
_WORSE = 0.02
"""Share by which images may agree less once a loop is closed: on a doubled surface each has its own."""


class ScanState(Enum):
    """What became of a frame."""

    EMPTY = "empty"
    """It shows hardly any surface; nothing was done."""
    SCANNING = "scanning"
    """The camera was found, and the image was fused."""
    UNSURE = "unsure"
    """The image leaves open where the camera is, as a blank wall does; it was not fused."""
    LOST = "lost"
    """The camera was not found; the image was not fused."""
    FOUND = "found"
    """A lost camera may be found; it is fused once the next frame agrees."""


@dataclass(frozen=True)
class ScanStep:
    """What became of a frame.

    Attributes:
        state: see :class:`ScanState`.
        world_from_camera: (4, 4) the camera's pose, the last one known where it was not found, and the
            likeliest where it is unsure.
        alignment: how well the image fits; None for the first one, and for an empty one.
        room: whether the memory held all that is new; where it did not once, nothing is fused any more.
    """

    state: ScanState
    world_from_camera: Float
    alignment: Alignment | None = None
    room: bool = True


@dataclass(frozen=True)
class LeftAside:
    """Half-size pixels (h, w) without which a camera is found.

    Attributes:
        moving: they show what moves by itself: nothing of them is fused; or None.
        doubtful: they show what may begin to move: they are left aside where the others tell the camera's
            place surely, and fused as long as they are not ``moving``; or None.
    """

    moving: Bool | None = None
    doubtful: Bool | None = None


def empty_volumes(settings: VolumeSettings) -> list[DistanceVolume]:
    """Returns volumes without a surface, from the finest to the coarsest, as a camera is tracked in."""
    sizes = [settings.voxel * _COARSER**level for level in range(_LEVELS)]
    reaches = [settings.reach] + [settings.far] * (_LEVELS - 1)
    return [DistanceVolume(settings, size, reach) for size, reach in zip(sizes, reaches, strict=True)]


class Scanner:
    """Fuses the frames of one moving camera.

    The world is that of the first frame: of its own pose where it has one, else of a level camera at the
    origin.

    Attributes:
        full: whether the memory was full: from then on images are tracked only, and what is there is kept.

    Raises:
        InputError: where a frame is of another camera than the first.
    """

    def __init__(self, settings: ScanSettings | None = None) -> None:
        self.settings = settings or ScanSettings()
        self.volumes = empty_volumes(self.settings.volume)
        self.tracker = CameraTracker(self.volumes, self.settings.tracking)
        self.keyframes = Keyframes()
        self.poses: list[tuple[int, Float]] = []
        self.history = FrameHistory(self.settings.loops.history)
        self._ups: list[Float | None] = []
        self._camera: tuple[Intrinsics, DepthPreparation] | None = None
        self.view: DepthView | None = None
        self._prepared: tuple[DepthFrame, DepthView] | None = None
        self._pose, self._before = np.eye(4), np.eye(4)
        self._state = ScanState.EMPTY
        self.full = False

    @property
    def megabytes(self) -> float:
        """Memory of all volumes, and of the images that are kept."""
        return sum(volume.megabytes for volume in self.volumes) + self.history.megabytes

    @property
    def pose(self) -> Float:
        """(4, 4) where the camera was in the newest image in which it was known."""
        return self._pose

    @property
    def predicted(self) -> Float:
        """(4, 4) where the camera is in the next image, if it goes on as it went."""
        return np.asarray(self._pose @ np.linalg.inv(self._before) @ self._pose)

    def add(self, frame: DepthFrame, up: Float | None = None, aside: LeftAside | None = None) -> ScanStep:
        """Find the camera of a frame, and fuse the image where that is sure.

        Args:
            up: (3,) unit vector, camera frame, that points up as its accelerometer feels it, or None.
            aside: pixels without which the camera is found, or None.
        """
        view, aside = self.prepared(frame), aside or LeftAside()
        self.view = view
        if aside.moving is not None:
            view, frame = only(view, ~aside.moving), _without(frame, aside.moving)
        if view.known < self.settings.least_depth:
            return ScanStep(ScanState.EMPTY, self._pose)
        if not self.poses:
            given = frame.world_from_camera
            self._pose = LEVEL_WORLD_FROM_CAMERA.copy() if given is None else np.array(given, float)
            self._pose[:3, :3] = nearest_rotation(self._pose[:3, :3])
            self._before = self._pose
            return self._fuse(frame, view, self._pose, None, up)
        if self._state in (ScanState.LOST, ScanState.EMPTY):
            return self._sought(view, up)
        found = self._tracked(view, up, aside.doubtful)
        self._state = ScanState.LOST if self._too_far(found, frame.time_ns) else self._judged(found)
        if self._state is ScanState.UNSURE:
            # What is known of the way is gone along, or a camera that moves on would not be found after it.
            self._before, self._pose = self._pose, found.world_from_camera
        if self._state is not ScanState.SCANNING:
            return ScanStep(self._state, self._pose, found)
        return self._fuse(frame, view, found.world_from_camera, found, up)

    def place(self, frame: DepthFrame, world_from_camera: Float) -> ScanStep:
        """Fuse an image at the pose of its camera, where that is known, as of a scan that was kept."""
        pose = np.array(world_from_camera, float)
        return self._fuse(frame, self.prepared(frame), pose, None, None)

    def look_again(self) -> None:
        """Forget where the camera is, as after it was put down: it is sought where it was before."""
        if self.poses:
            self._state = ScanState.LOST

    def close_loops(self) -> ClosedWay | None:
        """Bend the camera's way so that what it saw twice lies in one place, and fuse its images again.

        The way stays as it is where it closes already, or where the images agree less well after it.

        Returns:
            What was found; None where nothing was scanned.
        """
        if self._camera is None or not self.poses:
            return None
        s, poses = self.settings, [pose for _, pose in self.poses]
        found = closed_way(self.history, poses, self._ups, self._camera[1], s)
        if found.moved < _STAYED * s.volume.voxel:
            return found
        volumes, keyframes = self._fused_again(found.poses)
        tracker = CameraTracker(volumes, s.tracking)
        if found.agreement(tracker, found.poses) < found.agreement(self.tracker, poses) - _WORSE:
            return found
        self.volumes, self.tracker, self.keyframes = volumes, tracker, keyframes
        self.poses = [(time, pose) for (time, _), pose in zip(self.poses, found.poses, strict=True)]
        self._pose = self._before = found.poses[-1]
        return replace(found, taken=True)

    def _fused_again(self, poses: list[Float]) -> tuple[list[DistanceVolume], Keyframes]:
        """Returns the volumes and keyframes of the images that are still there, at other poses.

        Of very many only every second one, or fewer, are fused: each counts for those between.
        """
        volumes, keyframes = empty_volumes(self.settings.volume), Keyframes()
        numbers = self.history.numbers
        every = max(len(numbers) // _MANY, 1)
        frames = self.history.frames(list(numbers)[::every])
        views = made_ahead((number, self.prepared(frame)) for number, frame in frames)
        for count, (number, view) in enumerate(views):
            if every > 1:
                view = replace(view, weights=view.weights * np.float32(every))
            for volume in volumes if every == 1 or count % _ROUGHLY == 0 else volumes[:1]:
                volume.integrate(view, poses[number])
            if count % _CLEANED == _CLEANED - 1:
                for volume in volumes:
                    volume.clean()
            keyframes.offer(view, poses[number])
        return volumes, keyframes

    def surface(self, since: int = 0) -> Mesh:
        """Returns the surface that was scanned, metres, world: by the images from number ``since`` on."""
        if not since:
            return surface_of(self.volumes[0])
        volume = DistanceVolume(self.settings.volume)
        for number, frame in self.history.frames():
            if number >= since:
                volume.integrate(self.prepared(frame), self.poses[number][1])
        return surface_of(volume)

    def thing(self) -> Mesh:
        """Returns what stands on the floor, cut out of the surface: upright, on y = 0, metres.

        Raises:
            InputError: where no floor was scanned, or nothing that stands on it.
        """
        surface, cut = self.surface(), self.settings.cut_out
        return cut_out(surface, find_ground(surface, settings=cut), focus_of([p for _, p in self.poses]), cut)

    def prepared(self, frame: DepthFrame) -> DepthView:
        """Returns the view of a frame; of the same one again, the view that was made."""
        if self._prepared is not None and self._prepared[0] is frame:
            return self._prepared[1]
        if self._camera is None:
            v = self.settings.volume
            self._camera = frame.intrinsics, DepthPreparation(frame.intrinsics, v.noise, v.near, v.far)
        if frame.intrinsics != self._camera[0]:
            what = "the camera of this frame is not that of the first"
            raise InputError(what, where=frame.sensor, mend="Scan with one camera, of one image size.")
        colour = frame.colour if self.settings.volume.colour else None
        self._prepared = frame, self._camera[1].prepare(frame.depth, colour)
        return self._prepared[1]

    def _tracked(self, view: DepthView, up: Float | None, doubtful: Bool | None = None) -> Alignment:
        """Returns the pose of an image that follows the last one; from farther away where it must be."""
        predicted = self.predicted
        if doubtful is not None:
            found = self.tracker.align(only(view, ~doubtful), predicted, up)
            if self._judged(found) is ScanState.SCANNING:
                return found
        found = self.tracker.align(view, predicted, up)
        if self._judged(found) is ScanState.SCANNING:
            return found
        others = [self.tracker.align(view, start, up, _LEVELS - 1) for start in (predicted, self._pose)]
        if self._judged(found) is ScanState.UNSURE:
            close = (self.tracker.align_closely(view, one.world_from_camera, up) for one in (found, *others))
            sure = [one for one in close if one.deviation < _SURER * self.settings.tracking.unsure]
            return max(sure, key=_fit, default=found)
        return max((found, *others), key=_fit)

    def _sought(self, view: DepthView, up: Float | None) -> ScanStep:
        """Looks for a lost camera where it was before."""
        starts = [self._pose, *self.keyframes.nearest(view, _TRIED)]
        found = max((self.tracker.align(view, start, up, _LEVELS - 1) for start in starts), key=_fit)
        if self._judged(found) is not ScanState.SCANNING:
            self._state = ScanState.LOST
            return ScanStep(ScanState.LOST, self._pose, found)
        self._pose = self._before = found.world_from_camera
        self._state = ScanState.FOUND
        return ScanStep(ScanState.FOUND, self._pose, found)

    def _judged(self, found: Alignment) -> ScanState:
        """Returns what an alignment is worth: SCANNING, UNSURE or LOST."""
        s = self.settings.tracking
        if found.overlap < s.overlap or found.agreeing < s.agreeing:
            return ScanState.LOST
        return ScanState.UNSURE if found.deviation > s.unsure else ScanState.SCANNING

    def _too_far(self, found: Alignment, time_ns: int) -> bool:
        """Returns whether nothing that is carried could have come there since the last image."""
        passed = max(1e-9 * (time_ns - self.poses[-1][0]), _FRAME)
        way = float(np.linalg.norm(found.world_from_camera[:3, 3] - self._pose[:3, 3]))
        return way > self.settings.tracking.fastest * passed + _SLACK

    def _fuse(
        self, frame: DepthFrame, view: DepthView, pose: Float, found: Alignment | None, up: Float | None
    ) -> ScanStep:
        """Fuses an image at a pose."""
        self._before, self._pose, self._state = self._pose, pose, ScanState.SCANNING
        if self.full:
            return ScanStep(ScanState.SCANNING, pose, found, room=False)
        self.full = not all([volume.integrate(view, pose).room for volume in self.volumes])
        self.history.add(len(self.poses), frame)
        self.poses.append((frame.time_ns, pose))
        self._ups.append(up)
        self.keyframes.offer(view, pose)
        if len(self.poses) % _CLEANED == 0:
            for volume in self.volumes:
                volume.clean()
        return ScanStep(ScanState.SCANNING, pose, found, not self.full)


def _without(frame: DepthFrame, own: Bool) -> DepthFrame:
    """Returns a frame that knows no depth at some half-size pixels (h, w)."""
    height, width = frame.depth.shape
    wide = own.repeat(2, 0).repeat(2, 1)[:height, :width]
    return replace(frame, depth=np.where(wide, 0, frame.depth).astype(frame.depth.dtype))


def _fit(found: Alignment) -> float:
    """Returns how well an image fits, to choose among several poses."""
    return found.agreeing * found.overlap
