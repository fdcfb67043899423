"""Scans a person in front of a fixed camera. The person turns around once, or stands still, so that one side
is scanned.
"""

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
from enliven.possession import make_standing_figure
from enliven.scanning import (
    ExcludedPixels,
    GroundPlane,
    Scanner,
    ScanSettings,
    ScanState,
    ScanStep,
    cut_out,
    find_parts,
    level_mesh,
)
from enliven_edge.scanning.feet import MAX_FOOT_HEIGHT_M, feet_pixels
from enliven_edge.tracking.tracker import Tracker

MAX_PERSON_DISTANCE_M = 3.5
"""Maximum distance of a person in metres. At this distance, a pixel is 6 mm wide, and the depth error is 2
cm."""
PERSON_VOXEL_M = 0.008
"""Voxel size for a person in metres. At a distance of two metres, a pixel and the noise of a Kinect have this
size. With smaller voxels the person's rotation is often ambiguous."""
_DIRECTIONS = 12
"""Number of directions around a person who are counted separately, of 30 degrees each."""
_MAX_TURN = np.deg2rad(50.0)
"""Rotation in radians since the first image above which joints are ignored. If the person is seen from
behind, the tracker may swap left and right."""
_MIN_CONFIDENCE = 0.5
"""Minimum confidence of the joints that are used."""
_MOVED_JOINT_M = 0.12
"""Distance in metres of a joint from its usual position on the body above which its limb counts as moved."""
_MIN_MOVED_FRACTION = 0.2
"""Minimum fraction of images with a moved joint before the user is notified."""
_MIN_JOINT_IMAGES = 5
"""Minimum number of images to estimate a joint."""
_FOOT_CUT_M = 0.04
"""Height above the floor in metres at which feet are cut off. Lower parts are visible in some images only."""
_MAX_HOLE_M = 0.6
"""Maximum boundary size in metres of holes that are filled. The largest hole is the crown, which a level
camera does not see from above."""
_MAX_CAMERA_ERROR_M = 0.25
"""Tolerated position uncertainty in metres of the camera around a person. It equals 7 degrees of rotation at
a distance of two metres."""
_UP = np.array([0.0, 1.0, 0.0])
_LIMBS = {
    "left arm": (Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.HAND_LEFT),
    "right arm": (Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT, Joint.HAND_RIGHT),
    "left leg": (Joint.KNEE_LEFT, Joint.ANKLE_LEFT),
    "right leg": (Joint.KNEE_RIGHT, Joint.ANKLE_RIGHT),
}
"""The joints that are checked for limb motion."""
_ENDS = (Joint.HEAD, Joint.HAND_LEFT, Joint.HAND_RIGHT, Joint.FOOT_LEFT, Joint.FOOT_RIGHT)
"""The end joints that drive a mesh limb by limb, in the order of :class:`ActorSettings`."""

_TRUNK = (Joint.HIP_CENTER, Joint.SHOULDER_CENTER, Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT)
"""The trunk joints (hip and neck first), which must be known to estimate missing joints."""


@dataclass(frozen=True)
class ScannedPerson:
    """A person as a mesh.

    Attributes:
        mesh: the upright mesh in metres, standing on y = 0. +Z is the direction in which the person first
            faced the camera.
        joints: (20, 3) metres in the mesh, NaN for joints that were not seen.
    """

    mesh: Mesh
    joints: Float

    @property
    def ends(self) -> Float:
        """Returns the (5, 3) end positions of head, hands and feet in metres, or (0, 3) if one of them was
        not seen.
        """
        ends = self.joints[list(_ENDS)].copy()
        if not np.isfinite(ends).all():
            return np.empty((0, 3))
        ends[0, 1] = self.mesh.bounds[1, 1]
        return ends

    @property
    def bones(self) -> Float:
        """Returns the (20, 3) positions of all joints in metres, or (0, 3) without a trunk.

        Joints that were not seen are taken from a standing person.
        """
        joints, (hip, neck) = self.joints.copy(), self.joints[[Joint.HIP_CENTER, Joint.SHOULDER_CENTER]]
        if not np.isfinite(joints[list(_TRUNK)]).all():
            return np.empty((0, 3))
        figure = make_standing_figure()
        size = np.linalg.norm(neck - hip) / np.linalg.norm(figure[_TRUNK[1]] - figure[_TRUNK[0]])
        for joint in np.flatnonzero(~np.isfinite(joints).all(1)):
            parent = PARENTS[joint]
            joints[joint] = joints[parent] + size * (figure[joint] - figure[parent])
        return joints


class PersonScanner(Scanner):
    """Fuses one person. The world frame is fixed to the body, so the camera orbits around a turning person.

    The project's tracker provides the person's pixels and joints. The first person found is scanned.

    Attributes:
        absent: number of images without the person, since the person first appeared.
        lost: number of images with the person, but with unknown rotation.
    """

    def __init__(self, settings: ScanSettings | None = None, tracker: Tracker | None = None) -> None:
        settings = settings or ScanSettings()
        tracking = replace(settings.tracking, unsure=max(settings.tracking.unsure, _MAX_CAMERA_ERROR_M))
        super().__init__(replace(settings, tracking=tracking))
        self._people = tracker or Tracker()
        self._person: int | None = None
        self._joints: list[tuple[Float, Float]] = []
        self.absent = self.lost = 0

    def add(
        self, frame: DepthFrame, up: Float | None = None, aside: ExcludedPixels | None = None
    ) -> ScanStep:
        """Finds the person in a frame, and fuses the person's pixels. See :meth:`Scanner.add`."""
        bodies = self._people.track(replace(frame, world_from_camera=None))
        body = self._choose_person(bodies)
        if body is None or (person_pixels := self._person_pixels(frame, body)) is None:
            self.absent += self._person is not None
            return ScanStep(ScanState.EMPTY, self._pose)
        pose = self._people.world_from_camera
        depth = np.where(person_pixels, frame.depth, 0).astype(frame.depth.dtype)
        step = super().add(replace(frame, depth=depth, world_from_camera=pose), up, aside)
        self.lost += step.state in (ScanState.LOST, ScanState.UNSURE)
        if step.state is ScanState.SCANNING and pose is not None:
            self._store_joints(body, step.world_from_camera @ np.linalg.inv(pose))
        return step

    def __deepcopy__(self, memo: dict[int, Any]) -> PersonScanner:
        """Copies the scan. The tracker is shared, because it contains the person's current position."""
        clone = type(self).__new__(type(self))
        memo[id(self)], memo[id(self._people)] = clone, self._people
        clone.__dict__.update({name: copy.deepcopy(value, memo) for name, value in vars(self).items()})
        return clone

    @property
    def missing(self) -> float:
        """Returns the fraction in [0, 1] of the directions around the person who were not scanned yet."""
        angles = [np.arctan2(pose[0, 2], pose[2, 2]) for _, pose in self.poses]
        return (
            1.0
            - len({int(angle // (2 * np.pi / _DIRECTIONS)) % _DIRECTIONS for angle in angles}) / _DIRECTIONS
        )

    def finish_person(self) -> ScannedPerson:
        """Returns the scanned person.

        Raises:
            InputError: if no part of the person was scanned.
        """
        surface, joints = self.extract_surface(), self._median_joints()
        if not len(surface.faces):
            remedy = "Stand nearer to the camera, or scan for longer."
            raise InputError("no surface was visible in enough images", where="scan", remedy=remedy)
        focus = joints[Joint.SPINE] if np.isfinite(joints[Joint.SPINE]).all() else surface.vertices.mean(0)
        # Cut the mesh off above the ragged edge of the soles, and extend it down to the floor. This also
        # completes feet that were hidden or outside the image.
        cut = replace(
            self.settings.cut_out, number=1, clearance=_FOOT_CUT_M, hole=_MAX_HOLE_M, drawn=MAX_FOOT_HEIGHT_M
        )
        # If no floor is visible, use the lowest visible point as the floor.
        floor = GroundPlane(_UP, 0.0 if self.is_on_floor else float(surface.vertices[:, 1].min()) - 1.0, 0.0)
        parts = find_parts(surface, floor, focus, cut)
        if not parts:
            remedy = "Stand nearer to the camera, with the whole body in view."
            raise InputError("too little of the person was scanned", where="scan", remedy=remedy)
        if self.is_on_floor:
            mesh = cut_out(surface, floor, focus, cut)
        else:
            floor = GroundPlane(_UP, float(parts[0].vertices[:, 1].min()), 0.0)
            mesh = level_mesh(parts[0], floor)
        middle = parts[0].bounds.mean(0)
        return ScannedPerson(mesh, joints - np.array([middle[0], floor.offset, middle[2]]))

    def raise_scan_error(self, where: str) -> None:
        """Raises an error with the reason why no mesh can be made.

        Raises:
            InputError: if no person was seen, or not enough of the person.
        """
        if self._person is None:
            remedy = "Stand one to three metres in front of the fixed camera, with nothing in between."
            raise InputError("no person was seen", where=where, remedy=remedy)
        if not self.poses:
            remedy = "Stand nearer to the camera, and scan for longer."
            raise InputError("too little of the person was seen", where=where, remedy=remedy)

    def advice(self, frames: int) -> list[str]:
        """Returns one sentence for each problem that can be avoided in the next scan."""
        sentences = []
        if self.absent:
            sentences.append(f"In {self.absent} of {frames} images the person was out of view; stay in view.")
        if self.lost > _MIN_MOVED_FRACTION * frames:
            problem = (
                f"{self.lost} of {frames} images are not in the mesh, because the rotation was not clear."
            )
            sentences.append(f"{problem} Take five seconds or more for the turn, and keep your pose.")
        moved_limbs = self.measure_limb_motion()
        if moved_limbs:
            limbs = " and the ".join(
                f"{limb} (by {100 * distance:.0f} cm)" for limb, distance in moved_limbs.items()
            )
            sentences.append(f"The {limbs} moved; keep arms and legs still while you turn.")
        return sentences

    def measure_limb_motion(self) -> dict[str, float]:
        """Returns the limbs that moved often, with their distance in metres from the usual position on the
        body.
        """
        median, moved_limbs = self._median_joints(), {}
        for limb, joints in _LIMBS.items():
            distances = [
                max(
                    float(np.linalg.norm(place[j] - median[j]))
                    if is_confident[j] >= _MIN_CONFIDENCE and np.isfinite(median[j]).all()
                    else 0.0
                    for j in joints
                )
                for place, is_confident in self._joints
            ]
            is_moved = [distance for distance in distances if distance > _MOVED_JOINT_M]
            if len(is_moved) > max(_MIN_MOVED_FRACTION * len(distances), 1):
                moved_limbs[limb] = float(np.median(is_moved))
        return moved_limbs

    @property
    def is_on_floor(self) -> bool:
        """Returns True if the floor was seen. The person then stands on it."""
        state = self._people.state
        return state is not None and state.floor_known

    def _choose_person(self, bodies: list[Body]) -> Body | None:
        """Returns the scanned person: the one with the most pixels in the first image."""
        if self._person is None and bodies:
            counts = Counter(self._people.owner[self._people.owner >= 0].tolist())  # type: ignore[index]
            order = [index for index, _ in counts.most_common()]
            ids = [person.id for person in self._people.performers]
            self._person = next((ids[k] for k in order if k < len(ids)), bodies[0].id)
        return next((body for body in bodies if body.id == self._person), None)

    def _person_pixels(self, frame: DepthFrame, body: Body) -> Bool | None:
        """Returns a mask (H, W) of the person's pixels, including feet, or None if there are none."""
        owner, pose = self._people.owner, self._people.world_from_camera
        index = next(
            (k for k, performer in enumerate(self._people.performers) if performer.id == body.id), -1
        )
        if owner is None or pose is None or index < 0 or not (owner == index).any():
            return None
        height, width = frame.depth.shape
        rows = np.minimum(np.arange(height) * owner.shape[0] // height, owner.shape[0] - 1)
        columns = np.minimum(np.arange(width) * owner.shape[1] // width, owner.shape[1] - 1)
        person_mask: Bool = (owner == index)[rows[:, None], columns]
        return person_mask | feet_pixels(frame, body, pose) if self.is_on_floor else person_mask

    def _store_joints(self, body: Body, object_from_room: Float) -> None:
        """Stores the joints in the body frame, if the person has turned little since the first image."""
        turn_angle = np.arccos(np.clip((np.trace(object_from_room[:3, :3]) - 1) / 2, -1.0, 1.0))
        if turn_angle < _MAX_TURN:
            places = body.joints @ object_from_room[:3, :3].T + object_from_room[:3, 3]
            self._joints.append((places, body.confidence))

    def _median_joints(self) -> Float:
        """Returns the median position (20, 3) of each joint, NaN if it was seen too rarely."""
        joints = np.full((len(Joint), 3), np.nan)
        for joint in Joint:
            places = [
                place[joint] for place, is_confident in self._joints if is_confident[joint] >= _MIN_CONFIDENCE
            ]
            if len(places) >= _MIN_JOINT_IMAGES:
                joints[joint] = np.median(places, axis=0)
        return joints
