"""A scan of a person before a camera that stands still: who turns once round, or holds still for one side."""

from __future__ import annotations

import copy
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from enliven.arrays import Bool, Float
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven.meshes import Mesh
from enliven.person import PARENTS, Body, Joint
from enliven.possession import standing_figure
from enliven.scanning import (
    Ground,
    LeftAside,
    Scanner,
    ScanSettings,
    ScanState,
    ScanStep,
    cut_out,
    levelled,
    parts_about,
)
from enliven_edge.scanning.feet import LOW, feet_pixels
from enliven_edge.tracking import Tracker

FARTHEST = 3.5
"""Metres beyond which a person is too far: a pixel is 6 mm wide there, and depth is off by 2 cm."""
PERSON_VOXEL = 0.008
"""Metres of a voxel's side that suits a person at two metres: a pixel and a Kinect's noise are as wide there,
and in smaller voxels it is often not clear how they are turned."""
_SIDES = 12
"""Directions about a person, of 30 degrees each, that are told apart."""
_FACING = np.deg2rad(50.0)
"""Radians of the turn from the first image up to which joints count: from behind, left and right may be
exchanged."""
_SEEN = 0.5
"""Confidence from which a joint's place counts."""
_HELD = 0.12
"""Metres that a joint may be away from its place on the body before it is said that the limb moved."""
_OFTEN = 0.2
"""Share of the images in which it must be."""
_FEWEST = 5
"""Images that tell where a joint is."""
_RIM = 0.04
"""Metres above the floor at which feet are cut: what is lower is seen in some images only."""
_CROWN = 0.6
"""Metres of the rim of a hole that is closed: a level camera does not see a crown from above."""
_UNSURE = 0.25
"""Metres by which the camera's place about a person may be off: at two metres a turn of 7 degrees."""
_UP = np.array([0.0, 1.0, 0.0])
_LIMBS = {
    "left arm": (Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.HAND_LEFT),
    "right arm": (Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT, Joint.HAND_RIGHT),
    "left leg": (Joint.KNEE_LEFT, Joint.ANKLE_LEFT),
    "right leg": (Joint.KNEE_RIGHT, Joint.ANKLE_RIGHT),
}
"""The joints by which it is seen that a limb moved."""
_ENDS = (Joint.HEAD, Joint.HAND_LEFT, Joint.HAND_RIGHT, Joint.FOOT_LEFT, Joint.FOOT_RIGHT)
"""The joints at the ends by which a mesh is held limb by limb, in the order of :class:`ActorSettings`."""

_TRUNK = (Joint.HIP_CENTER, Joint.SHOULDER_CENTER, Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT)
"""The joints without which it is not known where the others are: hip and neck first."""


@dataclass(frozen=True)
class ScannedPerson:
    """A person as a mesh.

    Attributes:
        mesh: upright, on y = 0, facing +Z as they first faced the camera, metres.
        joints: (20, 3) metres in the mesh, NaN where a joint was not seen.
    """

    mesh: Mesh
    joints: Float

    @property
    def ends(self) -> Float:
        """(5, 3) the ends of head, hands and feet; (0, 3) where one of them was not seen."""
        ends = self.joints[list(_ENDS)].copy()
        if not np.isfinite(ends).all():
            return np.empty((0, 3))
        ends[0, 1] = self.mesh.bounds[1, 1]
        return ends

    @property
    def bones(self) -> Float:
        """(20, 3) all joints, those that were not seen as of a person who stands; (0, 3) without a trunk."""
        joints, (hip, neck) = self.joints.copy(), self.joints[[Joint.HIP_CENTER, Joint.SHOULDER_CENTER]]
        if not np.isfinite(joints[list(_TRUNK)]).all():
            return np.empty((0, 3))
        figure = standing_figure()
        size = np.linalg.norm(neck - hip) / np.linalg.norm(figure[_TRUNK[1]] - figure[_TRUNK[0]])
        for joint in np.flatnonzero(~np.isfinite(joints).all(1)):
            parent = PARENTS[joint]
            joints[joint] = joints[parent] + size * (figure[joint] - figure[parent])
        return joints


class PersonScanner(Scanner):
    """Fuses one person; the body is the world, so as they turn the camera goes round them.

    The project's tracker says which pixels are theirs, and where their joints are. Who is found first is
    meant.

    Attributes:
        absent: images in which they were not in view, from the first one that showed them on.
        lost: images in which they were in view, and it was not found how they were turned.
    """

    def __init__(self, settings: ScanSettings | None = None, tracker: Tracker | None = None) -> None:
        settings = settings or ScanSettings()
        tracking = replace(settings.tracking, unsure=max(settings.tracking.unsure, _UNSURE))
        super().__init__(replace(settings, tracking=tracking))
        self._people = tracker or Tracker()
        self._person: int | None = None
        self._joints: list[tuple[Float, Float]] = []
        self.absent = self.lost = 0

    def add(self, frame: DepthFrame, up: Float | None = None, aside: LeftAside | None = None) -> ScanStep:
        """Find the person in a frame, and fuse what shows them; see :meth:`Scanner.add`."""
        bodies = self._people.track(replace(frame, world_from_camera=None))
        body = self._meant(bodies)
        if body is None or (own := self._pixels(frame, body)) is None:
            self.absent += self._person is not None
            return ScanStep(ScanState.EMPTY, self._pose)
        pose = self._people.world_from_camera
        depth = np.where(own, frame.depth, 0).astype(frame.depth.dtype)
        step = super().add(replace(frame, depth=depth, world_from_camera=pose), up, aside)
        self.lost += step.state in (ScanState.LOST, ScanState.UNSURE)
        if step.state is ScanState.SCANNING and pose is not None:
            self._note(body, step.world_from_camera @ np.linalg.inv(pose))
        return step

    def __deepcopy__(self, memo: dict[int, Any]) -> PersonScanner:
        """Copies what was scanned; the tracker, which knows where the person is now, is the same."""
        made = type(self).__new__(type(self))
        memo[id(self)], memo[id(self._people)] = made, self._people
        made.__dict__.update({name: copy.deepcopy(value, memo) for name, value in vars(self).items()})
        return made

    @property
    def missing(self) -> float:
        """Share of the directions about the person from which they were not scanned yet, 0..1."""
        angles = [np.arctan2(pose[0, 2], pose[2, 2]) for _, pose in self.poses]
        return 1.0 - len({int(angle // (2 * np.pi / _SIDES)) % _SIDES for angle in angles}) / _SIDES

    def person(self) -> ScannedPerson:
        """Returns the person.

        Raises:
            InputError: where nothing of them was scanned.
        """
        surface, joints = self.surface(), self._median()
        if not len(surface.faces):
            mend = "Stand nearer, or scan for longer."
            raise InputError("no surface was seen often enough", where="scan", mend=mend)
        focus = joints[Joint.SPINE] if np.isfinite(joints[Joint.SPINE]).all() else surface.vertices.mean(0)
        # They are cut off above the rims of their soles, and what the cut took is given back to them; so is
        # what is not seen of feet from before, or where the image ends.
        cut = replace(self.settings.cut_out, number=1, clearance=_RIM, hole=_CROWN, drawn=LOW)
        # Where no floor is seen they stand on the lowest of what is.
        floor = Ground(_UP, 0.0 if self.on_floor else float(surface.vertices[:, 1].min()) - 1.0, 0.0)
        parts = parts_about(surface, floor, focus, cut)
        if not parts:
            mend = "Stand whole in view, and nearer."
            raise InputError("too little of the person was scanned", where="scan", mend=mend)
        if self.on_floor:
            mesh = cut_out(surface, floor, focus, cut)
        else:
            floor = Ground(_UP, float(parts[0].vertices[:, 1].min()), 0.0)
            mesh = levelled(parts[0], floor)
        middle = parts[0].bounds.mean(0)
        return ScannedPerson(mesh, joints - np.array([middle[0], floor.offset, middle[2]]))

    def refuse(self, where: str) -> None:
        """Say why there is nothing to make a mesh of.

        Raises:
            InputError: where no person was seen.
        """
        if self._person is None:
            mend = "Stand one to three metres before the camera, which stands still, with nothing before you."
            raise InputError("no person was seen", where=where, mend=mend)
        if not self.poses:
            mend = "Stand nearer, and scan for longer."
            raise InputError("too little of the person was seen", where=where, mend=mend)

    def advice(self, frames: int) -> list[str]:
        """Returns a sentence for each thing that would make the scan better."""
        said = []
        if self.absent:
            said.append(f"In {self.absent} of {frames} images the person was out of view; stay in it.")
        if self.lost > _OFTEN * frames:
            what = (
                f"{self.lost} of {frames} images are not in the mesh: it was not clear how they were turned."
            )
            said.append(f"{what} Turn in five seconds or more, as one piece.")
        moved = self.limbs_moved()
        if moved:
            limbs = " and the ".join(f"{limb} (by {100 * way:.0f} cm)" for limb, way in moved.items())
            said.append(f"The {limbs} moved; keep arms and legs still while you turn.")
        return said

    def limbs_moved(self) -> dict[str, float]:
        """Returns by how many metres limbs were away from their place on the body, those that were often."""
        median, moved = self._median(), {}
        for limb, joints in _LIMBS.items():
            ways = [
                max(
                    float(np.linalg.norm(place[j] - median[j]))
                    if sure[j] >= _SEEN and np.isfinite(median[j]).all()
                    else 0.0
                    for j in joints
                )
                for place, sure in self._joints
            ]
            far = [way for way in ways if way > _HELD]
            if len(far) > max(_OFTEN * len(ways), 1):
                moved[limb] = float(np.median(far))
        return moved

    @property
    def on_floor(self) -> bool:
        """Whether the floor was seen, and they stand on it."""
        state = self._people.state
        return state is not None and state.floor_known

    def _meant(self, bodies: list[Body]) -> Body | None:
        """Returns the person who is scanned; the nearest one at first."""
        if self._person is None and bodies:
            counts = Counter(self._people.owner[self._people.owner >= 0].tolist())  # type: ignore[index]
            order = [index for index, _ in counts.most_common()]
            ids = [person.id for person in self._people.performers]
            self._person = next((ids[k] for k in order if k < len(ids)), bodies[0].id)
        return next((body for body in bodies if body.id == self._person), None)

    def _pixels(self, frame: DepthFrame, body: Body) -> Bool | None:
        """Returns (H, W) the pixels of the person, feet included; None where there are none."""
        owner, pose = self._people.owner, self._people.world_from_camera
        index = next((k for k, one in enumerate(self._people.performers) if one.id == body.id), -1)
        if owner is None or pose is None or index < 0 or not (owner == index).any():
            return None
        height, width = frame.depth.shape
        rows = np.minimum(np.arange(height) * owner.shape[0] // height, owner.shape[0] - 1)
        columns = np.minimum(np.arange(width) * owner.shape[1] // width, owner.shape[1] - 1)
        own: Bool = (owner == index)[rows[:, None], columns]
        return own | feet_pixels(frame, body, pose) if self.on_floor else own

    def _note(self, body: Body, object_from_room: Float) -> None:
        """Keeps where the joints are on the body, while it faces about as at first."""
        turned = np.arccos(np.clip((np.trace(object_from_room[:3, :3]) - 1) / 2, -1.0, 1.0))
        if turned < _FACING:
            places = body.joints @ object_from_room[:3, :3].T + object_from_room[:3, 3]
            self._joints.append((places, body.confidence))

    def _median(self) -> Float:
        """Returns (20, 3) the middle of each joint's places, NaN where it was seen too seldom."""
        joints = np.full((len(Joint), 3), np.nan)
        for joint in Joint:
            places = [place[joint] for place, sure in self._joints if sure[joint] >= _SEEN]
            if len(places) >= _FEWEST:
                joints[joint] = np.median(places, axis=0)
        return joints
