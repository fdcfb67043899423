"""A simulated scan during which hands pick up the object, turn it and put it down.

The true poses of camera and object are known in each frame.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from enliven import rotation
from enliven.arrays import Float
from enliven.frames import DepthFrame
from enliven.meshes import Mesh
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan

_LIFT_HEIGHT_M = 0.2
"""Height in metres of an object above its resting position in the middle of a move."""
_GRIP_TIME_S = 0.4
"""Seconds for which the hands hold the object before it moves, and after it comes to rest."""
_ARM_LENGTH_M = 0.7
"""Visible length of an arm in metres, from the hand."""
_ARM_RADIUS_M = 0.035
"""Radius of an arm in metres."""
_HAND_RADIUS_M = 0.05
"""Radius of a closed hand in metres."""
_ARM_CORNERS = 12
"""Number of corners of an arm's cross-section. The polygon is within a millimetre of a circle."""
_SKIN_COLOUR = (205, 150, 125)
"""sRGB of hands and arms."""


@dataclass(frozen=True)
class MovedObjectPath:
    """The path of an object that rests, is moved by hands, and rests again.

    Attributes:
        rests: (4, 4) world_from_object, the object's pose at each rest.
        times: (begin, end) in seconds of each move between two rests.
        grips: points in metres, in the object's frame, at which the hands hold the object.
        towards: direction from the object to the person who moves it, world frame.
    """

    rests: Sequence[Float]
    times: Sequence[tuple[float, float]]
    grips: Sequence[tuple[float, float, float]] = ()
    towards: tuple[float, float, float] = (0.0, 0.6, -1.0)

    def world_from_object(self, time: float) -> Float:
        """Returns the (4, 4) pose of the object at a time in seconds."""
        pose = np.array(self.rests[0], float)
        for (begin, end), start, stop in zip(self.times, self.rests[:-1], self.rests[1:], strict=True):
            if time <= begin:
                break
            share = min((time - begin) / (end - begin), 1.0)
            # Ease the move, so that it starts and stops smoothly.
            share = share * share * (3.0 - 2.0 * share)
            turn = rotation.slerp(
                rotation.from_matrix(start[:3, :3]), rotation.from_matrix(stop[:3, :3]), np.array(share)
            )
            pose = np.eye(4)
            pose[:3, :3] = rotation.to_matrix(turn)
            pose[:3, 3] = start[:3, 3] + share * (stop[:3, 3] - start[:3, 3])
            pose[1, 3] += _LIFT_HEIGHT_M * math.sin(math.pi * share)
        return pose

    def is_held(self, time: float) -> bool:
        """Returns True if hands hold the object."""
        return any(begin - _GRIP_TIME_S < time < end + _GRIP_TIME_S for begin, end in self.times)

    def arms(self, time: float) -> list[Mesh]:
        """Returns the meshes of the arms that hold the object, world frame."""
        if not self.is_held(time):
            return []
        pose, away = self.world_from_object(time), rotation.unit(np.array(self.towards))
        hands = [pose[:3, :3] @ np.array(grip) + pose[:3, 3] for grip in self.grips]
        return [make_arm(hand, hand + _ARM_LENGTH_M * away) for hand in hands]


@dataclass(frozen=True)
class FollowingPath(HandheldPath):
    """The path of a camera that turns to another point after the object was moved.

    Attributes:
        later: (x, y, z) point in metres that the camera looks at after the move.
        turning: (begin, end) in seconds of the turn to that point.
        nod: amplitude in metres of the vertical oscillation of the camera's target, for objects larger than
            the image.
        nods: frequency of that oscillation in Hz.
    """

    later: tuple[float, float, float] = (0.0, 0.4, 0.0)
    turning: tuple[float, float] = (14.0, 17.0)
    nod: float = 0.0
    nods: float = 0.25

    def world_from_camera(self, time: float) -> Float:
        """Returns the (4, 4) pose of the camera at a time in seconds from the start."""
        begin, end = self.turning
        share = min(max((time - begin) / (end - begin), 0.0), 1.0)
        x, y, z = (
            start + share * (stop - start) for start, stop in zip(self.target, self.later, strict=True)
        )
        y += self.nod * math.sin(2.0 * math.pi * self.nods * time)
        names = ("radius", "height", "turns", "seconds", "sway", "shake", "seed")
        plain = HandheldPath(target=(x, y, z), **{name: getattr(self, name) for name in names})
        return plain.world_from_camera(time)


class MovingObject(Protocol):
    """Protocol of a moving object: its pose at each time in seconds, and the arms that hold it."""

    def world_from_object(self, time: float) -> Float:
        """Returns the (4, 4) pose of the object."""

    def arms(self, time: float) -> list[Mesh]:
        """Returns the meshes of the arms, world frame."""


class MovedObjectScan(HandheldScan):
    """A scan by a hand-held camera, during which the object is moved.

    Args:
        way: the path of the object. The other arguments are those of :class:`HandheldScan`.
    """

    def __init__(self, scanned_mesh: Mesh, way: MovingObject, *arguments: object, **named: object) -> None:
        super().__init__(scanned_mesh, *arguments, **named)  # type: ignore[arg-type]
        self.way = way

    def object_pose(self, index: int) -> Float:
        """Returns the true (4, 4) world_from_object of a frame."""
        return self.way.world_from_object(index / self.profile.camera.fps)

    def frame(self, index: int, scanned_mesh: Mesh | None = None) -> DepthFrame:
        """Returns the frame with that number. It shows the object at its pose, and the arms that hold it."""
        scanned_mesh, pose = scanned_mesh or self.scanned_mesh, self.object_pose(index)
        placed = replace(scanned_mesh, vertices=scanned_mesh.vertices @ pose[:3, :3].T + pose[:3, 3])
        arms = self.way.arms(index / self.profile.camera.fps)
        return super().frame(index, merge_meshes([placed, *arms]))


def make_lying_on_back_pose(scanned_mesh: Mesh, place: tuple[float, float] = (0.0, 0.0)) -> Float:
    """Returns the (4, 4) pose of an object that lies on its back on y = 0 at (x, z).

    The object originally faced +Z.
    """
    pose = np.eye(4)
    pose[:3, :3] = rotation.to_matrix(rotation.from_rotation_vector(np.array([-math.pi / 2, 0.0, 0.0])))
    turned = scanned_mesh.vertices @ pose[:3, :3].T
    low, high = turned.min(0), turned.max(0)
    pose[:3, 3] = [place[0] - (low + high)[0] / 2, -low[1], place[1] - (low + high)[2] / 2]
    return pose


def merge_meshes(meshes: Sequence[Mesh]) -> Mesh:
    """Merges meshes into one.

    If some have colours, those without become grey.
    """
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    colours = None
    if any(mesh.colours is not None for mesh in meshes):
        grey = np.full((1, 3), 128, np.uint8)
        colours = np.concatenate(
            [np.repeat(grey, len(m.vertices), 0) if m.colours is None else m.colours for m in meshes]
        )
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    return Mesh(vertices, np.concatenate(faces).astype(np.int32), meshes[0].name, colours)


def make_arm(hand: Float, shoulder: Float, thick: float = 1.0) -> Mesh:
    """Returns the mesh of an arm that starts with a closed hand at ``hand`` (3,). The mesh is a row of rings,
    closed at both ends.

    Args:
        thick: thickness relative to an arm. A trunk has 4.
    """
    along = rotation.unit(shoulder - hand)
    turn = rotation.to_matrix(rotation.swing(np.array([0.0, 0.0, 1.0]), along))
    length = float(np.linalg.norm(shoulder - hand))
    angles = np.linspace(0.0, math.pi, 7)[:-1]
    fist, wrist = thick * _HAND_RADIUS_M, thick * _ARM_RADIUS_M
    rings = [(-fist * math.cos(a), max(fist * math.sin(a), 1e-4)) for a in angles if a < 2.4]
    rings += [(1.4 * fist, wrist), (length, wrist), (length + 1e-3, 1e-4)]
    around = 2.0 * math.pi * np.arange(_ARM_CORNERS) / _ARM_CORNERS
    points = np.concatenate(
        [np.stack([r * np.cos(around), r * np.sin(around), np.full(_ARM_CORNERS, z)], 1) for z, r in rings]
    )
    k, n = np.meshgrid(np.arange(len(rings) - 1), np.arange(_ARM_CORNERS), indexing="ij")
    a, b = k * _ARM_CORNERS + n, k * _ARM_CORNERS + (n + 1) % _ARM_CORNERS
    quads = np.stack([a, b, b + _ARM_CORNERS, a + _ARM_CORNERS], -1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    colours = np.tile(np.array(_SKIN_COLOUR, np.uint8), (len(points), 1))
    return Mesh(points @ turn.T + hand, faces, "arm", colours)
