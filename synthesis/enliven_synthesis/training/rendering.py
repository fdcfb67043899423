"""Training pictures: a made-up person before one of the known sensors, with the part at every pixel.

Renders at about the size at which the tracker works, with each sensor's own faults, and takes away what a
tracker's view of somebody lacks: feet in the floor band, whatever stands before them, what leaves the image.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Float32, UInt8
from enliven.camera import Intrinsics, rays
from enliven_edge.sensors import load_profile
from enliven_edge.tracking.estimator import NOBODY
from enliven_synthesis.body import PIECES, Anatomy, Figure, Performer, Proportions
from enliven_synthesis.sensor import DepthNoise, Renderer
from enliven_synthesis.training.body_poses import random_figure
from enliven_synthesis.training.clutter import piece_of_wall, random_thing
from enliven_synthesis.training.labelling import label_pixels

Dice = np.random.Generator

SENSORS = ("kinect1", "kinect2", "oak-d", "oak-d-lite", "realsense-d415", "tof")
WIDTH = 200
"""Pixels across of the pictures."""
_PIECE_NUMBERS = np.arange(len(PIECES), dtype=np.int64)
_WALLS, _SUNK = 0.35, 0.08
"""Share of the things that are pieces of a wall; and of the pictures in which feet or shanks are lost."""
_STRAY = 0.12
"""Metres from the true surface beyond which a measurement is most often not taken for the person."""


@dataclass(frozen=True)
class Picture:
    """One person as a sensor sees them.

    Attributes:
        z: (h, w) float32 metres along the optical axis of the person's pixels, 0 elsewhere.
        around: (h, w) float32 the same of all that the sensor measures, what hides the person included.
        label: (h, w) the part, :data:`NOBODY` elsewhere.
        camera: (4,) fx, fy, cx, cy.
        world_from_camera: (4, 4).
        figure: the truth; None where it shows no person but a thing.
    """

    z: Float32
    around: Float32
    label: UInt8
    camera: Float
    world_from_camera: Float
    figure: Figure | None


class Studio:
    """Takes pictures; keeps what depends on the sensors only."""

    def __init__(self) -> None:
        self._cameras = []
        for seed, name in enumerate(SENSORS):
            profile = load_profile(name)
            full = profile.intrinsics()
            scaled = full.scaled(WIDTH / full.width)
            intrinsics = Intrinsics(*dataclasses.astuple(scaled)[:6])
            noise = DepthNoise(profile, intrinsics, seed)
            self._cameras.append((intrinsics, rays(intrinsics), Renderer(intrinsics), noise, profile.range))

    def picture(
        self, dice: Dice, family: str | None = None, arms: str | None = None, frontal: float = 0.0
    ) -> Picture:
        """A person of a random build in a random posture, seen from somewhere; never less than 60 pixels.

        Args:
            family: of :data:`enliven_synthesis.training.body_poses.FAMILIES`, by dice where None.
            arms: of :data:`enliven_synthesis.training.arm_poses.HOLDS`, by dice where None.
            frontal: share of people who look at the sensor; the others face anywhere.
        """
        while True:
            made = self._try(dice, family, arms, frontal)
            if np.count_nonzero(made.z) >= 60:
                return made

    def thing(self, dice: Dice) -> Picture:
        """What is no person, where one might be; never less than 60 pixels."""
        while True:
            _, figure, sensor, pose = self._placed(dice, None, None, 0.0)
            made = _partly_hidden(self.take_thing(figure, sensor, pose, dice), dice)
            if np.count_nonzero(made.z) >= 60:
                return made

    def _try(self, dice: Dice, family: str | None, arms: str | None, frontal: float) -> Picture:
        return _partly_hidden(self.take(*self._placed(dice, family, arms, frontal), dice), dice)

    def _placed(
        self, dice: Dice, family: str | None, arms: str | None, frontal: float
    ) -> tuple[Performer, Figure, int, Float]:
        """Somebody, a sensor, and the (4, 4) pose from which it looks at them."""
        performer = Performer(random_build(dice))
        yaw = dice.normal(0.0, 0.7) if dice.random() < frontal else dice.uniform(-np.pi, np.pi)
        figure = random_figure(performer, dice, yaw, family, arms)
        sensor = int(dice.integers(len(SENSORS)))
        intrinsics, _, _, _, limits = self._cameras[sensor]
        pose = _camera_pose(figure, intrinsics, max(limits.near, 0.5), min(limits.far, 4.5), dice)
        return performer, figure, sensor, pose

    def take(self, performer: Performer, figure: Figure, sensor: int, pose: Float, dice: Dice) -> Picture:
        """A picture of a figure by a sensor of :data:`SENSORS` that stands at the (4, 4) ``pose``."""
        _, ray, renderer, _, _ = self._cameras[sensor]
        flesh = Anatomy(performer).place(figure, np.linalg.inv(pose).astype(np.float64))
        depth, piece = _background(ray, pose, figure, dice), np.full(ray.shape[:2], NOBODY, np.uint8)
        renderer.draw(dataclasses.replace(flesh, material=_PIECE_NUMBERS), depth, piece)
        person = piece != NOBODY
        points = np.concatenate([ray[person], np.ones((person.sum(), 1))], 1) * depth[person, None]
        label = np.full(piece.shape, NOBODY, np.uint8)
        world = points @ pose[:3, :3].T + pose[:3, 3]
        label[person] = label_pixels(piece[person], world, figure, performer.scale)
        stuff = np.zeros(piece.shape, np.uint8)
        stuff[person] = flesh.material[piece[person]]
        made = self._measured(depth, stuff, person, sensor, pose, dice)
        return dataclasses.replace(
            made, label=np.where(made.z > 0, label, NOBODY).astype(np.uint8), figure=figure
        )

    def take_thing(self, instead: Figure, sensor: int, pose: Float, dice: Dice) -> Picture:
        """A picture of something else where a figure would be; the sensor and its pose as of :meth:`take`."""
        _, ray, _, _, _ = self._cameras[sensor]
        depth = _background(ray, pose, instead, dice)
        if dice.random() < _WALLS:
            inverse = np.linalg.inv(pose)
            here = instead.joints @ inverse[:3, :3].T + inverse[:3, 3]
            fx, fy, cx, cy = self._lens(sensor)
            z = np.maximum(here[:, 2], 0.2)
            rows, columns = fy * here[:, 1] / z + cy, fx * here[:, 0] / z + cx
            size = np.array([np.ptp(rows), np.ptp(columns)]) * dice.uniform(0.4, 1.4, 2)
            thing = piece_of_wall(depth.shape, np.array([rows.mean(), columns.mean()]), size, dice)
            thing &= np.isfinite(depth)
        else:
            direction = ray[..., :1] * pose[:3, 0] + ray[..., 1:] * pose[:3, 1] + pose[:3, 2]
            place = instead.joints[0, [0, 2]] + dice.normal(0.0, 0.15, 2)
            entries = [solid.entry(pose[:3, 3], direction) for solid in random_thing(place, dice)]
            nearest = np.minimum.reduce(entries)
            thing = nearest < depth
            depth = np.minimum(depth, nearest)
        return self._measured(depth, np.zeros(depth.shape, np.uint8), thing, sensor, pose, dice)

    def _lens(self, sensor: int) -> Float:
        """(4,) fx, fy, cx, cy."""
        intrinsics = self._cameras[sensor][0]
        return np.array([intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy])

    def _measured(
        self, depth: Float, stuff: UInt8, one: Bool, sensor: int, pose: Float, dice: Dice
    ) -> Picture:
        """What a sensor and a tracker make of (h, w) metres, the materials and the pixels of somebody."""
        _, ray, _, noise, _ = self._cameras[sensor]
        z = noise.corrupt(depth, stuff, int(dice.integers(2**31))).astype(np.float64) * 1e-3
        height = (pose[1, 0] * ray[..., 0] + pose[1, 1] * ray[..., 1] + pose[1, 2]) * z + pose[1, 3]
        stray = (np.abs(z - depth) > _STRAY) & (dice.random(z.shape) < 0.8)
        seen = one & (z > 0) & ~stray & (height > _floor_band(dice))
        theirs, nothing = np.where(seen, z, 0.0), np.full(z.shape, NOBODY, np.uint8)
        lens = self._lens(sensor)
        return Picture(theirs.astype(np.float32), z.astype(np.float32), nothing, lens, pose, None)


def _floor_band(dice: Dice) -> float:
    """Metres above the floor below which nothing is taken for the person: as trackers do; or more, a room
    that was learnt while they stood there."""
    return float(dice.uniform(0.07, 0.3) if dice.random() < _SUNK else dice.choice([-1.0, 0.03, 0.05, 0.07]))


def _partly_hidden(made: Picture, dice: Dice) -> Picture:
    """The picture with something before the person, in some of them."""
    hidden = _hidden(made.z > 0, dice)
    return dataclasses.replace(
        made,
        z=np.where(hidden, 0.0, made.z),
        around=np.where(hidden, _hider(made.z, dice), made.around).astype(np.float32),
        label=np.where(hidden, NOBODY, made.label).astype(np.uint8),
    )


def random_build(dice: Dice) -> Proportions:
    """Anybody from a child to a tall and stout adult."""
    height = dice.normal(1.72, 0.1) if dice.random() < 0.85 else dice.uniform(1.1, 1.6)
    return Proportions(
        float(np.clip(height, 1.05, 2.05)),
        float(np.clip(dice.normal(1.04, 0.13), 0.78, 1.5)),
        float(np.clip(dice.normal(1.0, 0.07), 0.82, 1.2)),
        float(np.clip(dice.normal(1.0, 0.08), 0.8, 1.25)),
        float(np.clip(dice.normal(1.0, 0.05), 0.86, 1.15)),
        float(np.clip(dice.normal(1.0, 0.05), 0.86, 1.15)),
    )


def _camera_pose(figure: Figure, camera: Intrinsics, near: float, far: float, dice: Dice) -> Float:
    """(4, 4) where the sensor stands: mostly all of the person in the image, sometimes a part of them."""
    low, high = figure.joints.min(0), figure.joints.max(0)
    middle = 0.5 * (low + high)
    if dice.random() < 0.25:  # close, at the upper body
        distance = dice.uniform(near, max(near + 0.3, 1.4))
        aim = figure.joints[int(dice.choice([0, 1, 2, 3]))] + dice.normal(0, 0.1, 3)
    else:
        whole = 0.62 * (high[1] - low[1] + 0.3) * camera.fy / (0.5 * camera.height)
        nearest = max(near, 0.6 * whole)
        distance = nearest + (max(far, nearest + 0.3) - nearest) * dice.random() ** 1.3
        aim = middle + dice.normal(0, 1.0, 3) * [0.12 * distance, 0.06 * distance, 0.0]
    height = dice.uniform(0.4, 2.3)
    height = aim[1] + np.clip(height - aim[1], -0.75 * distance, 0.75 * distance)
    flat = np.sqrt(max(distance**2 - (height - aim[1]) ** 2, 0.1))
    eye = np.array([aim[0], max(height, 0.25), aim[2] + flat])
    forward = aim - eye
    forward /= np.linalg.norm(forward)
    roll = dice.normal(0, 0.04)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    pose = np.eye(4)
    pose[:3, 0] = np.cos(roll) * right + np.sin(roll) * down
    pose[:3, 1] = np.cos(roll) * down - np.sin(roll) * right
    pose[:3, 2], pose[:3, 3] = forward, eye
    return pose


def _background(ray: Float, pose: Float, figure: Figure, dice: Dice) -> Float:
    """(h, w) metres of a floor and a wall behind the person."""
    direction = ray[..., :1] * pose[:3, 0] + ray[..., 1:] * pose[:3, 1] + pose[:3, 2]
    wall = float(figure.joints[:, 2].min()) - dice.uniform(0.3, 2.5)
    with np.errstate(divide="ignore"):
        to_wall = np.where(direction[..., 2] < 0, (wall - pose[2, 3]) / direction[..., 2], np.inf)
        to_floor = np.where(direction[..., 1] < 0, -pose[1, 3] / direction[..., 1], np.inf)
    return np.asarray(np.minimum(to_wall, to_floor))


def _hider(z: Float32, dice: Dice) -> float:
    """Metres to what hides somebody; 0 where nothing is measured of it."""
    seen = z[z > 0]
    return 0.0 if len(seen) == 0 or dice.random() < 0.3 else float(seen.min()) * dice.uniform(0.5, 0.95)


def _hidden(seen: Bool, dice: Dice) -> Bool:
    """(h, w) what something before the person hides, in one picture of five; and missing depth in some."""
    hidden = np.zeros(seen.shape, bool)
    rows, columns = np.nonzero(seen)
    if len(rows) == 0:
        return hidden
    if dice.random() < 0.2:
        top, left = dice.integers(rows.min(), rows.max() + 1), dice.integers(columns.min(), columns.max() + 1)
        tall, wide = np.ptp(rows) + 1, np.ptp(columns) + 1
        kind = dice.random()
        if kind < 0.4:  # a table: everything below
            hidden[max(top, rows.min() + tall // 3) :] = True
        elif kind < 0.7:  # somebody else, a pillar: everything to one side
            side = dice.random() < 0.5
            hidden[:, : left - wide // 4] = side
            hidden[:, left + wide // 4 :] = not side
        else:
            hidden[top : top + tall // 4 + 1, left : left + wide // 3 + 1] = True
    if dice.random() < 0.12:
        hidden |= dice.random(seen.shape) < dice.uniform(0.05, 0.4)
    return hidden
