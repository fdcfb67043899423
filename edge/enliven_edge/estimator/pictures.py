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
from enliven_edge.estimator.labels import NOBODY, label_pixels
from enliven_edge.estimator.postures import random_figure
from enliven_edge.sensors.profile import load_profile
from enliven_edge.synthesis.flesh import PIECES, Anatomy
from enliven_edge.synthesis.noise import DepthNoise
from enliven_edge.synthesis.performer import Figure, Performer, Proportions
from enliven_edge.synthesis.render import Renderer

Dice = np.random.Generator

SENSORS = ("kinect1", "kinect2", "oak-d", "oak-d-lite", "realsense-d415", "tof")
WIDTH = 200
"""Pixels across of the pictures."""
_PIECE_NUMBERS = np.arange(len(PIECES), dtype=np.int64)
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
        figure: the truth.
    """

    z: Float32
    around: Float32
    label: UInt8
    camera: Float
    world_from_camera: Float
    figure: Figure


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
            family: of :data:`enliven_edge.estimator.postures.FAMILIES`, by dice where None.
            arms: of :data:`enliven_edge.estimator.arms.HOLDS`, by dice where None.
            frontal: share of people who look at the sensor; the others face anywhere.
        """
        while True:
            made = self._try(dice, family, arms, frontal)
            if np.count_nonzero(made.z) >= 60:
                return made

    def _try(self, dice: Dice, family: str | None, arms: str | None, frontal: float) -> Picture:
        performer = Performer(random_build(dice))
        yaw = dice.normal(0.0, 0.7) if dice.random() < frontal else dice.uniform(-np.pi, np.pi)
        figure = random_figure(performer, dice, yaw, family, arms)
        sensor = int(dice.integers(len(SENSORS)))
        intrinsics, _, _, _, limits = self._cameras[sensor]
        pose = _camera_pose(figure, intrinsics, max(limits.near, 0.5), min(limits.far, 4.5), dice)
        made = self.take(performer, figure, sensor, pose, dice)
        hidden = _hidden(made.z > 0, dice)
        return dataclasses.replace(
            made,
            z=np.where(hidden, 0.0, made.z),
            around=np.where(hidden, _hider(made.z, dice), made.around).astype(np.float32),
            label=np.where(hidden, NOBODY, made.label).astype(np.uint8),
        )

    def take(self, performer: Performer, figure: Figure, sensor: int, pose: Float, dice: Dice) -> Picture:
        """A picture of a figure by a sensor of :data:`SENSORS` that stands at the (4, 4) ``pose``."""
        intrinsics, ray, renderer, noise, _ = self._cameras[sensor]
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
        z = noise.corrupt(depth, stuff, int(dice.integers(2**31))).astype(np.float64) * 1e-3
        height = (pose[1, 0] * ray[..., 0] + pose[1, 1] * ray[..., 1] + pose[1, 2]) * z + pose[1, 3]
        stray = (np.abs(z - depth) > _STRAY) & (dice.random(z.shape) < 0.8)
        seen = person & (z > 0) & ~stray & (height > dice.choice([-1.0, 0.03, 0.05, 0.07]))
        camera = np.array([intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy])
        return Picture(
            np.where(seen, z, 0.0).astype(np.float32), z.astype(np.float32),
            np.where(seen, label, NOBODY).astype(np.uint8), camera, pose, figure,
        )  # fmt: skip


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
