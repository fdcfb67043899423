"""A depth camera in a hand that is carried round a thing: known surface, known path, the sensor's faults."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from enliven import rotation
from enliven.arrays import Bool, Float, Int32, UInt8, UInt16
from enliven.camera import Intrinsics
from enliven.frames import DepthFrame
from enliven.meshes import Mesh
from enliven.scanning import draw_mesh
from enliven_synthesis.sensor.noise import DepthNoise
from enliven_synthesis.sensor.profile import SensorProfile
from enliven_synthesis.sensor.scene import Box, cast_room

STUDIO: tuple[Box, ...] = (
    Box((-3.0, -0.2, -3.0), (3.0, 0.0, 3.0)),  # floor
    Box((-3.0, 0.0, -3.2), (3.0, 2.6, -2.4)),  # two walls
    Box((-3.2, 0.0, -3.0), (-2.2, 2.6, 3.0)),
    Box((1.3, 0.0, -1.9), (1.75, 0.35, -1.5)),  # a carton, a box and a low cupboard
    Box((-1.6, 0.0, 1.1), (-1.35, 0.5, 1.3)),
    Box((0.9, 0.0, 1.9), (2.1, 0.8, 2.3)),
)
"""A floor, two walls and a few things that stand about; the middle is free."""
_SHADES = np.array([[168, 150, 128], [196, 190, 178]], np.uint8)
"""(2, 3) sRGB of the floor's and the walls' squares."""
_SQUARE = 0.25
"""Metres of a square of the floor's pattern: several are in view at a time."""
_SWAYS = 4
"""Waves that a hand's unrest is made of, from slow sway to tremor."""
_SLOWEST = 0.3
"""Hertz of the slowest wave: an arm sways about once in three seconds."""
_QUICKEST = 6.0
"""Hertz of the quickest wave: below a hand's tremor of 8 to 12, which a depth camera hardly sees."""
_NOWHERE = 65.0
"""Metres that a depth image in 16-bit millimetres cannot hold."""


@dataclass(frozen=True)
class HandheldPath:
    """The way of a camera that is carried round a thing and looks at it.

    Attributes:
        target: (x, y, z) metres, what is looked at.
        radius: metres from the target, level.
        height: metres above the floor, lowest and highest on the way.
        turns: times round the target.
        seconds: of the whole way.
        sway: metres of the hand's unrest, standard deviation of each coordinate.
        shake: radians of it about each axis.
        seed: another seed, another hand.
    """

    target: tuple[float, float, float] = (0.0, 0.5, 0.0)
    radius: float = 1.2
    height: tuple[float, float] = (0.7, 1.4)
    turns: float = 1.1
    seconds: float = 15.0
    sway: float = 0.01
    shake: float = 0.012
    seed: int = 0

    def world_from_camera(self, time: float) -> Float:
        """Returns the (4, 4) pose of the camera at a time in seconds from the start."""
        share = time / self.seconds
        angle = 2.0 * math.pi * self.turns * share
        low, high = self.height
        up = low + (high - low) * (0.5 - 0.5 * math.cos(2.0 * math.pi * share))
        unrest = self._unrest(time)
        target = np.array(self.target)
        eye = np.array(
            [target[0] + self.radius * math.sin(angle), up, target[2] + self.radius * math.cos(angle)]
        )
        pose = looking_at(eye + self.sway * unrest[:3], target)
        pose[:3, :3] = pose[:3, :3] @ rotation.to_matrix(
            rotation.from_rotation_vector(self.shake * unrest[3:])
        )
        return pose

    def _unrest(self, time: float) -> Float:
        """Returns (6,) sums of slow and quick waves of unit variance."""
        random = np.random.default_rng(self.seed)
        rates = _SLOWEST * (_QUICKEST / _SLOWEST) ** random.random((_SWAYS, 6))
        # Slow waves are wide: the speed of each is alike.
        sizes = 1.0 / rates
        sizes *= math.sqrt(2.0) / np.sqrt(np.square(sizes).sum(0))
        phases = 2.0 * math.pi * random.random((_SWAYS, 6))
        return np.asarray((sizes * np.sin(2.0 * math.pi * rates * time + phases)).sum(0))


def looking_at(eye: Float, target: Float) -> Float:
    """Returns the (4, 4) world_from_camera of an upright camera at ``eye`` (3,) that looks at ``target``."""
    ahead = rotation.unit(np.asarray(target, float) - eye)
    right = rotation.unit(np.cross(ahead, [0.0, 1.0, 0.0]))
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, np.cross(ahead, right), ahead, eye
    return pose


class HandheldScan:
    """Renders the frames of a scan by number: the same arguments and number always give the same frame.

    Args:
        thing: what is scanned, metres, world.
        profile: the camera.
        path: how it is carried.
        room: what stands round the thing.
        width: pixels across, None for the profile's own.
        noise: whether the camera has the faults of its profile, or none.
        colour: whether frames have a colour image, of the same pixels.
        seed: another seed, another camera of the same make.
    """

    def __init__(
        self,
        thing: Mesh,
        profile: SensorProfile,
        path: HandheldPath | None = None,
        room: tuple[Box, ...] = STUDIO,
        width: int | None = None,
        noise: bool = True,
        colour: bool = False,
        seed: int = 0,
    ) -> None:
        self.thing, self.profile, self.path, self._room = thing, profile, path or HandheldPath(), room
        self.intrinsics: Intrinsics = profile.intrinsics(width)
        self._noise = DepthNoise(profile, self.intrinsics, seed) if noise else None
        self._colour = colour
        self.sensor = f"handheld {profile.name}"

    @property
    def frames(self) -> int:
        """The number of frames on the whole way."""
        return round(self.path.seconds * self.profile.camera.fps)

    def pose(self, index: int) -> Float:
        """Returns the true (4, 4) world_from_camera of a frame, which the frame itself does not tell."""
        return self.path.world_from_camera(index / self.profile.camera.fps)

    def frame(self, index: int, thing: Mesh | None = None) -> DepthFrame:
        """Returns the frame of that number, with ``thing`` in place of what is scanned where it is given."""
        thing, pose = thing or self.thing, self.pose(index)
        depth, material = cast_room(self.intrinsics, pose, self._room)
        drawing = draw_mesh(thing, self.intrinsics, pose)
        before = drawing.depth < depth
        depth[before], material[before] = drawing.depth[before], 0
        image = self._noise.corrupt(depth, material, index) if self._noise else _whole_millimetres(depth)
        colour = (
            self._picture(thing, drawing.face, drawing.shares, before, depth, pose) if self._colour else None
        )
        time_ns = round(index * 1_000_000_000 / self.profile.camera.fps)
        return DepthFrame(image, self.intrinsics, time_ns, self.sensor, colour, sequence=index)

    def __iter__(self) -> Iterator[DepthFrame]:
        """Yields every frame of the way."""
        return (self.frame(index) for index in range(self.frames))

    def _picture(
        self, thing: Mesh, face: Int32, shares: Float, before: Bool, depth: Float, pose: Float
    ) -> UInt8:
        """Returns (H, W, 3) sRGB without light: the mesh's colours, and squares on all round it."""
        height, width = depth.shape
        rows, columns = np.mgrid[0:height, 0:width]
        i, z = self.intrinsics, np.minimum(depth, _NOWHERE)
        local = np.stack([(columns - i.cx) / i.fx * z, (rows - i.cy) / i.fy * z, z], -1)
        cells = np.floor((local @ pose[:3, :3].T + pose[:3, 3]) / _SQUARE + 1e-4).astype(int).sum(-1)
        picture = _SHADES[cells % 2].copy()
        if thing.colours is not None:
            corners = thing.colours[thing.faces[face[before]]].astype(float)
            picture[before] = np.rint((corners * shares[before][..., None]).sum(1)).astype(np.uint8)
        return picture


def _whole_millimetres(depth: Float) -> UInt16:
    """Returns (H, W) uint16 millimetres of a depth in metres, 0 where there is nothing."""
    return np.where(depth < _NOWHERE, np.rint(np.minimum(depth, _NOWHERE) * 1000.0), 0.0).astype(np.uint16)
