"""A scan of an object that is picked up, turned and put down meanwhile: room and object have a pose each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from enliven.arrays import Float
from enliven.frames import DepthFrame
from enliven.meshes import Mesh
from enliven.scanning.ground import cut_out, find_ground, focus_of, whole_part
from enliven.scanning.loops import FrameHistory
from enliven.scanning.objects.free_space import SeenDepth
from enliven.scanning.objects.joining import joined_object
from enliven.scanning.objects.object_model import ObjectModel
from enliven.scanning.objects.registration import Scanned, registered
from enliven.scanning.objects.rest import ObjectRest
from enliven.scanning.objects.surface_points import SurfacePoints
from enliven.scanning.scanner import ScanState, ScanStep
from enliven.scanning.settings import ScanSettings

_AGAIN = 1.6
"""Factor of a rest's images from one search to the next: each search takes as long as twenty of them."""
_TWICE = 2
"""Images one after the other that fit badly, with which what began to stand still ends: one is shaken."""
_LARGER = 1.5
"""Times the size of what is known of the object beyond which a thing is another one: a wall, a person."""


class ObjectState(Enum):
    """What is known of the object in a frame."""

    RESTING = "resting"
    """It stands, and the image was fused into it; before it is first moved it is a part of the room."""
    SETTLING = "settling"
    """Something stands still; it is not known yet that it is the object, or how it lies."""
    LOST = "lost"
    """It is carried, covered, or elsewhere; nothing was fused into it."""


@dataclass(frozen=True)
class MovedStep:
    """What became of a frame.

    Attributes:
        scan: of the room as it is since the object last came to rest; with the camera's pose in it.
        state: see :class:`ObjectState`.
        object_from_room: (4, 4) how the object lies in that room, or None while that is not known; the
            object's frame is the first room.
        rests: the number of rests at which it was found.
        sought: how often it was looked for, in vain, in what stands still now.
    """

    scan: ScanStep
    state: ObjectState
    object_from_room: Float | None
    rests: int
    sought: int = 0

    @property
    def told(self) -> ScanStep:
        """The scan's step, which is lost while the object is."""
        return replace(self.scan, state=ScanState.LOST) if self.state is ObjectState.LOST else self.scan

    @property
    def object_from_camera(self) -> Float | None:
        """(4, 4) the camera's pose in the object's frame, or None while that is not known."""
        if self.object_from_room is None or self.scan.state is not ScanState.SCANNING:
            return None
        return np.asarray(self.object_from_room @ self.scan.world_from_camera)


class MovedScanner:
    """Fuses an object that is moved while it is scanned, and the room about it.

    The object is what the settings choose of the things on the floor. While it stands, room and object are
    one scan, and both tell where the camera is. What then moves rigidly against the floor is the object: the
    rest ends, and nothing is fused while it is carried. Where things stand still again, a scan begins anew,
    and the object is looked for in it in every pose; images that saw through where it would be speak against
    a pose. At the end the object is cut out of every rest, and all their images become one surface.

    Attributes:
        rests: at which it is known how the object lies, in their order.
        unplaced: scans of something that stood still, in which the object was not found.
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
        self._known: tuple[int, Scanned] | None = None
        self.model: ObjectModel | None = None

    @property
    def megabytes(self) -> float:
        """Memory of all rests."""
        trial = [] if self._trial is None else [self._trial]
        model = 0.0 if self.model is None else self.model.megabytes
        return model + sum(rest.scanner.megabytes for rest in [*self.rests, *self.unplaced, *trial])

    def add(self, frame: DepthFrame, up: Float | None = None) -> MovedStep:
        """Find the camera and the object of a frame, and fuse the image where both are sure.

        Args:
            up: as of :meth:`Scanner.add`.
        """
        rest = self._now
        if rest is not None:
            step = rest.scanner.add(frame, up)
            if step.state is not ScanState.LOST:
                if not rest.moved(step):
                    self._trial = None
                    rest.look_again()
                    self._grow(rest, step)
                    return self._step(step, ObjectState.RESTING, rest)
                self._end(rest)
        return self._try(frame, up)

    def close_loops(self) -> None:
        """Close the camera's way at each rest, as :meth:`Scanner.close_loops` does."""
        for rest in self.rests:
            rest.scanner.close_loops()

    @property
    def now(self) -> ObjectRest | None:
        """The rest at which the object lies now; None while it is not known where it lies."""
        return self._now

    @property
    def history(self) -> FrameHistory:
        """The images of the first rest."""
        return self.rests[0].scanner.history

    @property
    def poses(self) -> list[tuple[int, Float]]:
        """Times, nanoseconds, and (4, 4) poses of the camera in the images of the first rest."""
        return self.rests[0].scanner.poses

    @property
    def full(self) -> bool:
        """Whether the memory for voxels is full."""
        return any(rest.scanner.full for rest in self.rests)

    def surface(self, since: int = 0) -> Mesh:
        """Returns the surface of the first room with the object in it, as :meth:`Scanner.surface` does."""
        return self.rests[0].scanner.surface(since)

    def thing(self) -> Mesh:
        """Returns the object as it stood first, of all its rests: upright, on y = 0, metres.

        Raises:
            InputError: where nothing stands on a floor.
        """
        first, whole = self.rests[0], self.surface()
        ground = find_ground(whole, settings=self.settings.cut_out)
        self._place_all()
        if len(self.rests) == 1:
            focus = focus_of([pose for _, pose in first.scanner.poses])
            return cut_out(whole, ground, focus, self.settings.cut_out)
        return whole_part(self.joined(), ground, self.settings.cut_out)

    def joined(self) -> Mesh:
        """Returns the surface of the object from all rests, metres, the world of the first one."""
        self._place_all()
        for rest in self.rests:
            rest.look(0)
        return joined_object(self.rests, self.settings)

    def _try(self, frame: DepthFrame, up: Float | None) -> MovedStep:
        """Scans anew what may stand still again, and looks for the object in it."""
        trial, s = self._trial, self.settings.moved
        if trial is None:
            trial = self._trial = ObjectRest(self.settings)
            self._search, self._doubts, self._sought = float(s.looks), 0, 0
        step = trial.scanner.add(frame, up)
        fits = step.alignment is None or step.alignment.agreeing >= s.agreeing
        self._doubts = 0 if fits and step.state is not ScanState.LOST else self._doubts + 1
        if self._doubts >= _TWICE or trial.moved(step):
            if trial.count >= s.known_after:
                trial.end()
                self.unplaced.append(trial)
            self._trial = None
            return self._step(step, ObjectState.LOST, None)
        if trial.count >= self._search:
            self._search *= _AGAIN
            if self._place(trial):
                if self._now is not None:
                    self._end(self._now)
                self._now, self._trial = trial, None
                if self.model is not None:
                    self.model.take(trial)
                return self._step(step, ObjectState.RESTING, trial)
            self._sought += 1
        return self._step(step, ObjectState.SETTLING, None)

    def _end(self, rest: ObjectRest) -> None:
        """Ends a rest; from the first one on the object grows alone."""
        rest.end()
        self._now = None
        if self.model is None:
            rest.look(0)
            self.model = ObjectModel(self.settings)
            self.model.take(rest)

    def _grow(self, rest: ObjectRest, step: ScanStep) -> None:
        """Fuses an image into what is known of the object alone."""
        view = rest.scanner.view
        if self.model is not None and view is not None and step.state is ScanState.SCANNING:
            self.model.add(view, rest, step.world_from_camera)

    def _place_all(self) -> None:
        """Looks for the object once more where it was not found: more of it is known than then."""
        if self._trial is not None and self._trial.count >= self.settings.moved.known_after:
            self.unplaced.append(self._trial)
        self._trial = None
        for rest in self.unplaced[:]:
            if self._place(rest):
                self.unplaced.remove(rest)
                if self.model is not None:
                    self.model.take(rest)

    def _place(self, rest: ObjectRest) -> bool:
        """Looks for the object in a rest; returns whether it was found."""
        rest.look(0)
        model = self._scanned() if rest.parts else None
        if model is None:
            return False
        size = np.linalg.norm(np.ptp(model.surface.points, axis=0))
        for number, part in enumerate(rest.parts):
            if np.linalg.norm(np.ptp(part.bounds, axis=0)) > _LARGER * size:
                continue
            found = registered(model, rest.scanned(number), self.settings.registration)
            if found is not None:
                rest.object_from_room = found.model_from_part
                rest.mean(number)
                self.rests.append(rest)
                return True
        return False

    def _scanned(self) -> Scanned | None:
        """Returns what is known of the object, of all rests at which it was found; None where nothing is."""
        if self._known is None or self._known[0] != len(self.rests):
            points, normals, views = list[Float](), list[Float](), list[SeenDepth]()
            for rest in self.rests:
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
            surface = SurfacePoints(np.concatenate(points), np.concatenate(normals))
            self._known = len(self.rests), Scanned(surface, views)
        return self._known[1]

    def _step(self, step: ScanStep, state: ObjectState, rest: ObjectRest | None) -> MovedStep:
        """Returns what became of a frame."""
        pose = None if rest is None else rest.object_from_room
        sought = self._sought if state is ObjectState.SETTLING else 0
        return MovedStep(step, state, pose, len(self.rests), sought)
