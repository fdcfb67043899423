"""A small scene for several synthetic people whose positions are functions of time."""

import dataclasses
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from enliven.camera import Intrinsics, world_from_level_camera
from enliven.frames import DepthFrame
from enliven_synthesis.body.body_sdf import BodyAnatomy
from enliven_synthesis.body.performer import Figure, Performer, Proportions
from enliven_synthesis.motion.choreographies import get_choreography
from enliven_synthesis.sensor.render import DepthRenderer
from enliven_synthesis.sensor.scene import ROOM, Box, cast_room

sys.path.insert(0, str(Path(__file__).parent))

FPS = 30
CAMERA = Intrinsics(212, 160, 175.0, 175.0, 105.5, 79.5)
MOUNT = world_from_level_camera(1.3, np.deg2rad(6))


@dataclasses.dataclass
class Player:
    """A synthetic person.

    Attributes:
        where: function from seconds to (x, z, yaw) in metres and radians, or to None while absent.
        does: name of the choreography.
    """

    where: Callable[[float], tuple[float, float, float] | None]
    does: str = "idle"
    build: Proportions = dataclasses.field(default_factory=Proportions)

    def __post_init__(self):
        self.performer = Performer(self.build)
        self.anatomy = BodyAnatomy(self.performer)
        self.choreography = get_choreography(self.does)

    def figure(self, time: float) -> Figure | None:
        """Returns the player's figure at a time."""
        place = self.where(time)
        if place is None:
            return None
        figure = self.performer.pose(self.choreography.posture(time % self.choreography.duration))
        x, z, yaw = place
        c, s = np.cos(yaw), np.sin(yaw)
        turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        home = figure.joints[0] * [1, 0, 1]
        frames = figure.frames.copy()
        frames[:, :, :3] = turn @ frames[:, :, :3]
        frames[:, :, 3] = (frames[:, :, 3] - home) @ turn.T + [x, 0, z]
        return Figure((figure.joints - home) @ turn.T + [x, 0, z], frames)


class Playground:
    """Renders players and boxes for one sensor.

    Args:
        boxes: function from seconds to the furniture, or None.
        mount: function from seconds to (4, 4) world_from_camera.
        told: True if frames state the sensor's pose.
    """

    def __init__(self, *players, boxes=None, mount=None, told=True, noise=0.0015, seed=0, camera=CAMERA):
        self.players, self.boxes, self.told, self.noise = players, boxes, told, noise
        self.mount = mount or (lambda time: MOUNT)
        self.camera = camera
        self._renderer = DepthRenderer(camera)
        self._random = np.random.default_rng(seed)
        self._rooms = {}

    def frame(self, time: float) -> DepthFrame:
        """Returns the sensor's view at a time in seconds."""
        mount = self.mount(time)
        extra = tuple(self.boxes(time)) if self.boxes else ()
        depth, material = self._room(mount, extra)
        camera_from_world = np.linalg.inv(mount)
        for player in self.players:
            figure = player.figure(time)
            if figure is not None:
                self._renderer.draw(player.anatomy.place(figure, camera_from_world), depth, material)
        with np.errstate(invalid="ignore"):
            depth = depth + self.noise * depth**2 * self._random.standard_normal(depth.shape)
        millimetres = np.where(np.isfinite(depth) & (depth < 6.0), depth * 1000, 0).astype(np.uint16)
        return DepthFrame(
            millimetres, self.camera, round(time * 1e9), "playground", mount if self.told else None
        )

    def joints(self, time: float) -> list[np.ndarray | None]:
        """Returns (20, 3) joints of every player, or None for absent players."""
        figures = [player.figure(time) for player in self.players]
        return [None if figure is None else figure.joints for figure in figures]

    def _room(self, mount, extra):
        key = (mount.tobytes(), extra)
        if key not in self._rooms:
            if len(self._rooms) > 50:
                self._rooms.clear()
            self._rooms[key] = cast_room(self.camera, mount, ROOM + extra)
        depth, material = self._rooms[key]
        return depth.copy(), material.copy()


def line(start, stop, begin, end, yaw=0.0):
    """Returns (x, z, yaw) over time, moving from ``start`` (x, z) to ``stop`` between two times."""

    def where(time):
        share = min(1.0, max(0.0, (time - begin) / (end - begin)))
        x, z = (1 - share) * np.asarray(start) + share * np.asarray(stop)
        return float(x), float(z), yaw

    return where


def still(x, z, yaw=0.0):
    """Returns a function with a constant position."""
    return lambda time: (x, z, yaw)


def during(where, *spans):
    """Returns a position function that is None outside the (begin, end) spans."""
    return lambda time: where(time) if any(a <= time < b for a, b in spans) else None


def watch(playground, tracker, seconds, start=0.0, fps=FPS):
    """Returns [(time, bodies, owners)]. ``owners`` has each player's body id within 0.3 m, or None."""
    log = []
    for i in range(round(seconds * fps)):
        time = start + i / fps
        bodies = tracker.track(playground.frame(time))
        log.append((time, bodies, owners(playground.joints(time), bodies)))
    return log


def owners(players, bodies):
    """Returns the id of the body at each player, or None."""
    matched = []
    for joints in players:
        best = None
        for body in bodies:
            if joints is not None:
                error = np.linalg.norm(body.joints - joints, axis=1).mean()
                if error < 0.3 and (best is None or error < best[0]):
                    best = (error, body.id)
        matched.append(None if best is None else best[1])
    return matched


@pytest.fixture(scope="session")
def stagecraft():
    """Gives tests access to the names in this file."""
    import types

    return types.SimpleNamespace(
        Player=Player, Playground=Playground, line=line, still=still, during=during, watch=watch,
        Proportions=Proportions, Box=Box, MOUNT=MOUNT, CAMERA=CAMERA,
    )  # fmt: skip
