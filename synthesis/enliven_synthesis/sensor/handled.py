"""A scan during which hands pick the thing up, turn it and put it down: two known poses in each frame."""

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

_LIFT = 0.2
"""Metres by which a thing is lifted in the middle of a move."""
_GRIP = 0.4
"""Seconds that hands are on the thing before it moves and after it stands."""
_ARM = 0.7
"""Metres of an arm that are in view, from the hand on."""
_WRIST = 0.035
"""Metres, radius of an arm."""
_HAND = 0.05
"""Metres, radius of a closed hand."""
_AROUND = 12
"""Corners of an arm's section: a millimetre off a circle."""
_SKIN = (205, 150, 125)
"""sRGB of hands and arms."""


@dataclass(frozen=True)
class HandledWay:
    """The way of a thing that rests, is moved by hands, and rests again.

    Attributes:
        rests: (4, 4) world_from_thing of each rest.
        times: seconds (begin, end) of each move between two rests.
        grips: points of the thing, its own frame, metres, that the hands hold.
        towards: direction, world, from the thing to the person who moves it.
    """

    rests: Sequence[Float]
    times: Sequence[tuple[float, float]]
    grips: Sequence[tuple[float, float, float]] = ()
    towards: tuple[float, float, float] = (0.0, 0.6, -1.0)

    def world_from_thing(self, time: float) -> Float:
        """Returns the (4, 4) pose of the thing at a time in seconds."""
        pose = np.array(self.rests[0], float)
        for (begin, end), one, other in zip(self.times, self.rests[:-1], self.rests[1:], strict=True):
            if time <= begin:
                break
            share = min((time - begin) / (end - begin), 1.0)
            # It starts and stops without a jolt.
            share = share * share * (3.0 - 2.0 * share)
            turn = rotation.slerp(
                rotation.from_matrix(one[:3, :3]), rotation.from_matrix(other[:3, :3]), np.array(share)
            )
            pose = np.eye(4)
            pose[:3, :3] = rotation.to_matrix(turn)
            pose[:3, 3] = one[:3, 3] + share * (other[:3, 3] - one[:3, 3])
            pose[1, 3] += _LIFT * math.sin(math.pi * share)
        return pose

    def held(self, time: float) -> bool:
        """Returns whether hands are on the thing."""
        return any(begin - _GRIP < time < end + _GRIP for begin, end in self.times)

    def arms(self, time: float) -> list[Mesh]:
        """Returns the arms that hold the thing, world."""
        if not self.held(time):
            return []
        pose, away = self.world_from_thing(time), rotation.unit(np.array(self.towards))
        hands = [pose[:3, :3] @ np.array(grip) + pose[:3, 3] for grip in self.grips]
        return [arm_mesh(hand, hand + _ARM * away) for hand in hands]


@dataclass(frozen=True)
class FollowingPath(HandheldPath):
    """The way of a camera that looks elsewhere after a move.

    Attributes:
        later: (x, y, z) metres, what is looked at in the end.
        turning: seconds (begin, end) in which it turns there.
        nod: metres by which what is looked at goes up and down, for things that do not fit into the picture.
        nods: times a second.
    """

    later: tuple[float, float, float] = (0.0, 0.4, 0.0)
    turning: tuple[float, float] = (14.0, 17.0)
    nod: float = 0.0
    nods: float = 0.25

    def world_from_camera(self, time: float) -> Float:
        """Returns the (4, 4) pose of the camera at a time in seconds from the start."""
        begin, end = self.turning
        share = min(max((time - begin) / (end - begin), 0.0), 1.0)
        x, y, z = (one + share * (two - one) for one, two in zip(self.target, self.later, strict=True))
        y += self.nod * math.sin(2.0 * math.pi * self.nods * time)
        names = ("radius", "height", "turns", "seconds", "sway", "shake", "seed")
        plain = HandheldPath(target=(x, y, z), **{name: getattr(self, name) for name in names})
        return plain.world_from_camera(time)


class MovingThing(Protocol):
    """Where a thing is at each time in seconds, and the arms that hold it."""

    def world_from_thing(self, time: float) -> Float:
        """Returns the (4, 4) pose of the thing."""

    def arms(self, time: float) -> list[Mesh]:
        """Returns the arms, world."""


class HandledScan(HandheldScan):
    """A scan by a carried camera of a thing that is moved meanwhile.

    Args:
        way: of the thing; all other arguments are those of a :class:`HandheldScan`.
    """

    def __init__(self, thing: Mesh, way: MovingThing, *arguments: object, **named: object) -> None:
        super().__init__(thing, *arguments, **named)  # type: ignore[arg-type]
        self.way = way

    def thing_pose(self, index: int) -> Float:
        """Returns the true (4, 4) world_from_thing of a frame."""
        return self.way.world_from_thing(index / self.profile.camera.fps)

    def frame(self, index: int, thing: Mesh | None = None) -> DepthFrame:
        """Returns the frame of that number, with the thing where it is then, and the arms that hold it."""
        thing, pose = thing or self.thing, self.thing_pose(index)
        placed = replace(thing, vertices=thing.vertices @ pose[:3, :3].T + pose[:3, 3])
        arms = self.way.arms(index / self.profile.camera.fps)
        return super().frame(index, joined([placed, *arms]))


def laid_on_its_back(thing: Mesh, place: tuple[float, float] = (0.0, 0.0)) -> Float:
    """Returns the (4, 4) pose in which a thing that looks along +Z lies on its back on y = 0 at (x, z)."""
    pose = np.eye(4)
    pose[:3, :3] = rotation.to_matrix(rotation.from_rotation_vector(np.array([-math.pi / 2, 0.0, 0.0])))
    turned = thing.vertices @ pose[:3, :3].T
    low, high = turned.min(0), turned.max(0)
    pose[:3, 3] = [place[0] - (low + high)[0] / 2, -low[1], place[1] - (low + high)[2] / 2]
    return pose


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Returns meshes as one; those without colours are grey where others have some."""
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


def arm_mesh(hand: Float, shoulder: Float, thick: float = 1.0) -> Mesh:
    """Returns an arm from a closed hand (3,) on; its surface is a row of rings, closed at both ends.

    Args:
        thick: times as thick as an arm; 4 for a trunk.
    """
    along = rotation.unit(shoulder - hand)
    turn = rotation.to_matrix(rotation.swing(np.array([0.0, 0.0, 1.0]), along))
    length = float(np.linalg.norm(shoulder - hand))
    angles = np.linspace(0.0, math.pi, 7)[:-1]
    fist, wrist = thick * _HAND, thick * _WRIST
    rings = [(-fist * math.cos(a), max(fist * math.sin(a), 1e-4)) for a in angles if a < 2.4]
    rings += [(1.4 * fist, wrist), (length, wrist), (length + 1e-3, 1e-4)]
    around = 2.0 * math.pi * np.arange(_AROUND) / _AROUND
    points = np.concatenate(
        [np.stack([r * np.cos(around), r * np.sin(around), np.full(_AROUND, z)], 1) for z, r in rings]
    )
    k, n = np.meshgrid(np.arange(len(rings) - 1), np.arange(_AROUND), indexing="ij")
    a, b = k * _AROUND + n, k * _AROUND + (n + 1) % _AROUND
    quads = np.stack([a, b, b + _AROUND, a + _AROUND], -1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    colours = np.tile(np.array(_SKIN, np.uint8), (len(points), 1))
    return Mesh(points @ turn.T + hand, faces, "arm", colours)
