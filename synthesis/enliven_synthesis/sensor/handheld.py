"""A simulated hand-held depth camera that is carried round an object.

The true surface and path are known, and the images have the sensor's faults.
"""

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
"""A room with a floor, two walls and a few objects. Its middle is free for the scanned object."""
_SHADES = np.array([[168, 150, 128], [196, 190, 178]], np.uint8)
"""(2, 3) sRGB of the two kinds of squares on floor and walls."""
_SQUARE_SIDE_M = 0.25
"""Side in metres of a square of the floor pattern. Several squares are in view at a time."""
_SWAY_WAVES = 4
"""Number of sine waves that make up the motion of the hand, from slow sway to tremor."""
_MIN_SWAY_HZ = 0.3
"""Frequency of the slowest wave in Hz. An arm sways about once in three seconds."""
_MAX_SWAY_HZ = 6.0
"""Frequency of the fastest wave in Hz. It is below a hand's tremor of 8 to 12 Hz, which a depth camera hardly
measures."""
_NO_DEPTH_M = 65.0
"""Maximum depth in metres. A depth image in 16-bit millimetres cannot store larger values."""


@dataclass(frozen=True)
class HandheldPath:
    """The path of a camera that is carried round an object and looks at it.

    Attributes:
        target: (x, y, z) point in metres that the camera looks at.
        radius: horizontal distance from the target in metres.
        height: minimum and maximum height above the floor in metres.
        turns: number of turns round the target.
        seconds: duration of the whole path.
        sway: standard deviation in metres of each coordinate of the hand motion.
        shake: standard deviation in radians of the hand's rotation about each axis.
        seed: random seed of the hand motion.
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
        shake = self._hand_motion(time)
        target = np.array(self.target)
        eye = np.array(
            [target[0] + self.radius * math.sin(angle), up, target[2] + self.radius * math.cos(angle)]
        )
        pose = look_at_pose(eye + self.sway * shake[:3], target)
        pose[:3, :3] = pose[:3, :3] @ rotation.to_matrix(
            rotation.from_rotation_vector(self.shake * shake[3:])
        )
        return pose

    def _hand_motion(self, time: float) -> Float:
        """Returns (6,) hand motion as sums of slow and fast waves, with unit variance."""
        random = np.random.default_rng(self.seed)
        rates = _MIN_SWAY_HZ * (_MAX_SWAY_HZ / _MIN_SWAY_HZ) ** random.random((_SWAY_WAVES, 6))
        # The amplitude falls with the frequency, so that all waves have about the same speed.
        amplitudes = 1.0 / rates
        amplitudes *= math.sqrt(2.0) / np.sqrt(np.square(amplitudes).sum(0))
        phases = 2.0 * math.pi * random.random((_SWAY_WAVES, 6))
        return np.asarray((amplitudes * np.sin(2.0 * math.pi * rates * time + phases)).sum(0))


def look_at_pose(eye: Float, target: Float) -> Float:
    """Returns the (4, 4) world_from_camera of an upright camera at ``eye`` (3,) that looks at ``target``."""
    ahead = rotation.unit(np.asarray(target, float) - eye)
    right = rotation.unit(np.cross(ahead, [0.0, 1.0, 0.0]))
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, np.cross(ahead, right), ahead, eye
    return pose


class HandheldScan:
    """Renders the frames of a scan by number. The same arguments and number always give the same frame.

    Args:
        scanned_mesh: the mesh of the scanned object in metres, world frame.
        profile: the camera.
        path: the path of the camera.
        room: the boxes around the object.
        width: width of the images in pixels, or None for the profile's width.
        noise: True to add the faults of the profile.
        colour: True to add a colour image with the same pixels.
        seed: random seed. Another seed simulates another camera of the same model.
    """

    def __init__(
        self,
        scanned_mesh: Mesh,
        profile: SensorProfile,
        path: HandheldPath | None = None,
        room: tuple[Box, ...] = STUDIO,
        width: int | None = None,
        noise: bool = True,
        colour: bool = False,
        seed: int = 0,
    ) -> None:
        self.scanned_mesh, self.profile, self.path, self._room = (
            scanned_mesh,
            profile,
            path or HandheldPath(),
            room,
        )
        self.intrinsics: Intrinsics = profile.intrinsics(width)
        self._noise = DepthNoise(profile, self.intrinsics, seed) if noise else None
        self._colour = colour
        self.sensor = f"handheld {profile.name}"

    @property
    def frames(self) -> int:
        """Returns the number of frames on the whole path."""
        return round(self.path.seconds * self.profile.camera.fps)

    def pose(self, index: int) -> Float:
        """Returns the true (4, 4) world_from_camera of a frame. The frame itself does not contain it."""
        return self.path.world_from_camera(index / self.profile.camera.fps)

    def frame(self, index: int, scanned_mesh: Mesh | None = None) -> DepthFrame:
        """Returns the frame with that number.

        If ``scanned_mesh`` is given, it replaces the scanned object.
        """
        scanned_mesh, pose = scanned_mesh or self.scanned_mesh, self.pose(index)
        depth, material = cast_room(self.intrinsics, pose, self._room)
        drawing = draw_mesh(scanned_mesh, self.intrinsics, pose)
        is_mesh = drawing.depth < depth
        depth[is_mesh], material[is_mesh] = drawing.depth[is_mesh], 0
        image = self._noise.add_noise(depth, material, index) if self._noise else _to_millimetres(depth)
        colour = (
            self._render_colours(scanned_mesh, drawing.face, drawing.barycentric, is_mesh, depth, pose)
            if self._colour
            else None
        )
        time_ns = round(index * 1_000_000_000 / self.profile.camera.fps)
        return DepthFrame(image, self.intrinsics, time_ns, self.sensor, colour, sequence=index)

    def __iter__(self) -> Iterator[DepthFrame]:
        """Yields every frame of the path."""
        return (self.frame(index) for index in range(self.frames))

    def _render_colours(
        self, scanned_mesh: Mesh, face: Int32, shares: Float, before: Bool, depth: Float, pose: Float
    ) -> UInt8:
        """Returns the (H, W, 3) sRGB image without lighting.

        It shows the mesh's colours, and squares on other surfaces.
        """
        height, width = depth.shape
        rows, columns = np.mgrid[0:height, 0:width]
        i, z = self.intrinsics, np.minimum(depth, _NO_DEPTH_M)
        local = np.stack([(columns - i.cx) / i.fx * z, (rows - i.cy) / i.fy * z, z], -1)
        cells = np.floor((local @ pose[:3, :3].T + pose[:3, 3]) / _SQUARE_SIDE_M + 1e-4).astype(int).sum(-1)
        picture = _SHADES[cells % 2].copy()
        if scanned_mesh.colours is not None:
            corners = scanned_mesh.colours[scanned_mesh.faces[face[before]]].astype(float)
            picture[before] = np.rint((corners * shares[before][..., None]).sum(1)).astype(np.uint8)
        return picture


def _to_millimetres(depth: Float) -> UInt16:
    """Converts a depth in metres to (H, W) uint16 millimetres. Rays that hit no surface get 0."""
    return np.where(depth < _NO_DEPTH_M, np.rint(np.minimum(depth, _NO_DEPTH_M) * 1000.0), 0.0).astype(
        np.uint16
    )
