"""Renders synthetic people in front of the supported sensors, with the body part at every pixel.

Images have about the tracker's working resolution, and the faults of the simulated sensor. Pixels that the
tracker would not assign to the person are removed: feet in the floor band, occluded parts, and parts outside
the image.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from enliven.arrays import Bool, Float, Float32, UInt8
from enliven.camera import Intrinsics, pixel_rays
from enliven_edge.tracking.estimator.labels import NOBODY
from enliven_synthesis.body.body_sdf import PIECES, BodyAnatomy
from enliven_synthesis.body.performer import Figure, Performer, Proportions
from enliven_synthesis.sensor.noise import DepthNoise
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.render import DepthRenderer
from enliven_synthesis.training.body_poses import random_figure
from enliven_synthesis.training.clutter import random_clutter, random_wall_piece
from enliven_synthesis.training.labelling import label_pixels

SENSORS = ("kinect1", "kinect2", "oak-d", "oak-d-lite", "realsense-d415", "tof")
"""Profiles of the sensors that people are rendered for, one of each kind."""
WIDTH = 200
"""Width of the images in pixels. It is about the width at which the tracker works."""
_PIECE_NUMBERS = np.arange(len(PIECES), dtype=np.int64)
"""(P,) numbers of the body pieces, which the renderer writes instead of materials."""
_WALL_FRACTION = 0.35
"""Fraction of the clutter images that show a piece of a wall. The others show furniture and similar
objects."""
_SUNK_FEET_FRACTION = 0.08
"""Fraction of images in which feet or shanks are missing. It simulates a background model with a floor that
is too high."""
_STRAY_DISTANCE_M = 0.12
"""Distance in metres from the true surface beyond which the tracker usually discards a measurement."""


@dataclass(frozen=True)
class RenderedPerson:
    """A sensor's view of one person, or of clutter instead of a person.

    Attributes:
        z: (h, w) float32 depth in metres along the optical axis at the person's pixels, and 0 elsewhere.
        around: (h, w) float32 depth in metres at all pixels, including occluders and background.
        label: (h, w) the body part, or the background label.
        camera: (4,) fx, fy, cx, cy.
        world_from_camera: (4, 4) pose of the sensor.
        figure: the true figure; None for clutter.
    """

    z: Float32
    around: Float32
    label: UInt8
    camera: Float
    world_from_camera: Float
    figure: Figure | None


class PersonRenderer:
    """Renders people and clutter. Caches the arrays that depend only on the sensors."""

    def __init__(self) -> None:
        self._cameras = []
        for seed, name in enumerate(SENSORS):
            profile = load_profile(name)
            full = profile.intrinsics()
            scaled = full.scale(WIDTH / full.width)
            intrinsics = Intrinsics(*dataclasses.astuple(scaled)[:6])
            noise = DepthNoise(profile, intrinsics, seed)
            self._cameras.append(
                (intrinsics, pixel_rays(intrinsics), DepthRenderer(intrinsics), noise, profile.range)
            )

    def render_person(
        self, rng: Generator, family: str | None = None, arms: str | None = None, frontal: float = 0.0
    ) -> RenderedPerson:
        """Renders a random person in a random posture from a random viewpoint.

        At least 60 pixels of the person are visible.

        Args:
            family: a name of :data:`enliven_synthesis.training.body_poses.FAMILIES`; None draws one at
                random.
            arms: a name of :data:`enliven_synthesis.training.arm_poses.HOLDS`; None draws one at random.
            frontal: fraction of people who face the sensor. The others face a random direction.
        """
        while True:
            rendered = self._render_random_person(rng, family, arms, frontal)
            if np.count_nonzero(rendered.z) >= 60:
                return rendered

    def render_clutter(self, rng: Generator) -> RenderedPerson:
        """Renders clutter instead of a person, with at least 60 visible pixels."""
        while True:
            _, figure, sensor, pose = self._random_view(rng, None, None, 0.0)
            rendered = _hide_part(self.render_clutter_at(figure, sensor, pose, rng), rng)
            if np.count_nonzero(rendered.z) >= 60:
                return rendered

    def _render_random_person(
        self, rng: Generator, family: str | None, arms: str | None, frontal: float
    ) -> RenderedPerson:
        return _hide_part(self.render_figure(*self._random_view(rng, family, arms, frontal), rng), rng)

    def _random_view(
        self, rng: Generator, family: str | None, arms: str | None, frontal: float
    ) -> tuple[Performer, Figure, int, Float]:
        """Returns a person, the number of a sensor, and the sensor's (4, 4) pose."""
        performer = Performer(random_build(rng))
        yaw = rng.normal(0.0, 0.7) if rng.random() < frontal else rng.uniform(-np.pi, np.pi)
        figure = random_figure(performer, rng, yaw, family, arms)
        sensor = int(rng.integers(len(SENSORS)))
        intrinsics, _, _, _, limits = self._cameras[sensor]
        pose = _camera_pose(figure, intrinsics, max(limits.near, 0.5), min(limits.far, 4.5), rng)
        return performer, figure, sensor, pose

    def render_figure(
        self, performer: Performer, figure: Figure, sensor: int, pose: Float, rng: Generator
    ) -> RenderedPerson:
        """Renders a figure for a sensor of :data:`SENSORS` with the (4, 4) ``pose``."""
        _, ray, renderer, _, _ = self._cameras[sensor]
        sdf = BodyAnatomy(performer).place(figure, np.linalg.inv(pose).astype(np.float64))
        depth, piece = _room_depth(ray, pose, figure, rng), np.full(ray.shape[:2], NOBODY, np.uint8)
        renderer.draw(dataclasses.replace(sdf, material=_PIECE_NUMBERS), depth, piece)
        person = piece != NOBODY
        points = np.concatenate([ray[person], np.ones((person.sum(), 1))], 1) * depth[person, None]
        label = np.full(piece.shape, NOBODY, np.uint8)
        world = points @ pose[:3, :3].T + pose[:3, 3]
        label[person] = label_pixels(piece[person], world, figure, performer.scale)
        stuff = np.zeros(piece.shape, np.uint8)
        stuff[person] = sdf.material[piece[person]]
        rendered = self._add_sensor_faults(depth, stuff, person, sensor, pose, rng)
        return dataclasses.replace(
            rendered, label=np.where(rendered.z > 0, label, NOBODY).astype(np.uint8), figure=figure
        )

    def render_clutter_at(self, instead: Figure, sensor: int, pose: Float, rng: Generator) -> RenderedPerson:
        """Renders clutter instead of a figure. For ``sensor`` and ``pose`` see :meth:`render_figure`."""
        _, ray, _, _, _ = self._cameras[sensor]
        depth = _room_depth(ray, pose, instead, rng)
        if rng.random() < _WALL_FRACTION:
            inverse = np.linalg.inv(pose)
            local_joints = instead.joints @ inverse[:3, :3].T + inverse[:3, 3]
            fx, fy, cx, cy = self._sensor_intrinsics(sensor)
            z = np.maximum(local_joints[:, 2], 0.2)
            rows, columns = fy * local_joints[:, 1] / z + cy, fx * local_joints[:, 0] / z + cx
            size = np.array([np.ptp(rows), np.ptp(columns)]) * rng.uniform(0.4, 1.4, 2)
            mask = random_wall_piece(depth.shape, np.array([rows.mean(), columns.mean()]), size, rng)
            mask &= np.isfinite(depth)
        else:
            direction = ray[..., :1] * pose[:3, 0] + ray[..., 1:] * pose[:3, 1] + pose[:3, 2]
            place = instead.joints[0, [0, 2]] + rng.normal(0.0, 0.15, 2)
            entries = [solid.entry(pose[:3, 3], direction) for solid in random_clutter(place, rng)]
            nearest = np.minimum.reduce(entries)
            mask = nearest < depth
            depth = np.minimum(depth, nearest)
        return self._add_sensor_faults(depth, np.zeros(depth.shape, np.uint8), mask, sensor, pose, rng)

    def _sensor_intrinsics(self, sensor: int) -> Float:
        """Returns (4,) fx, fy, cx, cy of a sensor."""
        intrinsics = self._cameras[sensor][0]
        return np.array([intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy])

    def _add_sensor_faults(
        self, depth: Float, stuff: UInt8, mask: Bool, sensor: int, pose: Float, rng: Generator
    ) -> RenderedPerson:
        """Adds the faults of sensor and tracker to a rendered image.

        The image consists of (h, w) depth in metres, materials, and the person's mask.
        """
        _, ray, _, noise, _ = self._cameras[sensor]
        z = noise.add_noise(depth, stuff, int(rng.integers(2**31))).astype(np.float64) * 1e-3
        height = (pose[1, 0] * ray[..., 0] + pose[1, 1] * ray[..., 1] + pose[1, 2]) * z + pose[1, 3]
        stray = (np.abs(z - depth) > _STRAY_DISTANCE_M) & (rng.random(z.shape) < 0.8)
        is_visible = mask & (z > 0) & ~stray & (height > _draw_floor_band(rng))
        person, nothing = np.where(is_visible, z, 0.0), np.full(z.shape, NOBODY, np.uint8)
        lens = self._sensor_intrinsics(sensor)
        return RenderedPerson(person.astype(np.float32), z.astype(np.float32), nothing, lens, pose, None)


def _draw_floor_band(rng: Generator) -> float:
    """Returns the height in metres above the floor below which the tracker assigns no pixels to the person.

    It is larger if the background was learnt while the person stood there.
    """
    return float(
        rng.uniform(0.07, 0.3) if rng.random() < _SUNK_FEET_FRACTION else rng.choice([-1.0, 0.03, 0.05, 0.07])
    )


def _hide_part(rendered: RenderedPerson, rng: Generator) -> RenderedPerson:
    """Hides a part of the person in some of the images.

    This simulates occlusion.
    """
    hidden = _draw_occlusion(rendered.z > 0, rng)
    return dataclasses.replace(
        rendered,
        z=np.where(hidden, 0.0, rendered.z),
        around=np.where(hidden, _draw_occluder_depth(rendered.z, rng), rendered.around).astype(np.float32),
        label=np.where(hidden, NOBODY, rendered.label).astype(np.uint8),
    )


def random_build(rng: Generator) -> Proportions:
    """Returns a random build, from a child to a tall, stout adult."""
    height = rng.normal(1.72, 0.1) if rng.random() < 0.85 else rng.uniform(1.1, 1.6)
    return Proportions(
        float(np.clip(height, 1.05, 2.05)),
        float(np.clip(rng.normal(1.04, 0.13), 0.78, 1.5)),
        float(np.clip(rng.normal(1.0, 0.07), 0.82, 1.2)),
        float(np.clip(rng.normal(1.0, 0.08), 0.8, 1.25)),
        float(np.clip(rng.normal(1.0, 0.05), 0.86, 1.15)),
        float(np.clip(rng.normal(1.0, 0.05), 0.86, 1.15)),
    )


def _camera_pose(figure: Figure, camera: Intrinsics, near: float, far: float, rng: Generator) -> Float:
    """Returns the (4, 4) pose of a sensor that sees the whole person, or sometimes only a part."""
    low, high = figure.joints.min(0), figure.joints.max(0)
    middle = 0.5 * (low + high)
    if rng.random() < 0.25:  # This is a close-up of the upper body.
        distance = rng.uniform(near, max(near + 0.3, 1.4))
        target = figure.joints[int(rng.choice([0, 1, 2, 3]))] + rng.normal(0, 0.1, 3)
    else:
        whole = 0.62 * (high[1] - low[1] + 0.3) * camera.fy / (0.5 * camera.height)
        nearest = max(near, 0.6 * whole)
        distance = nearest + (max(far, nearest + 0.3) - nearest) * rng.random() ** 1.3
        target = middle + rng.normal(0, 1.0, 3) * [0.12 * distance, 0.06 * distance, 0.0]
    height = rng.uniform(0.4, 2.3)
    height = target[1] + np.clip(height - target[1], -0.75 * distance, 0.75 * distance)
    flat = np.sqrt(max(distance**2 - (height - target[1]) ** 2, 0.1))
    eye = np.array([target[0], max(height, 0.25), target[2] + flat])
    forward = target - eye
    forward /= np.linalg.norm(forward)
    roll = rng.normal(0, 0.04)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    pose = np.eye(4)
    pose[:3, 0] = np.cos(roll) * right + np.sin(roll) * down
    pose[:3, 1] = np.cos(roll) * down - np.sin(roll) * right
    pose[:3, 2], pose[:3, 3] = forward, eye
    return pose


def _room_depth(ray: Float, pose: Float, figure: Figure, rng: Generator) -> Float:
    """Returns the depth (h, w) in metres of a floor and a wall behind the person."""
    direction = ray[..., :1] * pose[:3, 0] + ray[..., 1:] * pose[:3, 1] + pose[:3, 2]
    wall = float(figure.joints[:, 2].min()) - rng.uniform(0.3, 2.5)
    with np.errstate(divide="ignore"):
        to_wall = np.where(direction[..., 2] < 0, (wall - pose[2, 3]) / direction[..., 2], np.inf)
        to_floor = np.where(direction[..., 1] < 0, -pose[1, 3] / direction[..., 1], np.inf)
    return np.asarray(np.minimum(to_wall, to_floor))


def _draw_occluder_depth(z: Float32, rng: Generator) -> float:
    """Returns the depth in metres of the object that occludes a person; 0 if it is not measured."""
    seen = z[z > 0]
    return 0.0 if len(seen) == 0 or rng.random() < 0.3 else float(seen.min()) * rng.uniform(0.5, 0.95)


def _draw_occlusion(seen: Bool, rng: Generator) -> Bool:
    """Returns the occluded pixels (h, w).

    In one of five images an object occludes the person. In some images depth is missing.
    """
    hidden = np.zeros(seen.shape, bool)
    rows, columns = np.nonzero(seen)
    if len(rows) == 0:
        return hidden
    if rng.random() < 0.2:
        top, left = rng.integers(rows.min(), rows.max() + 1), rng.integers(columns.min(), columns.max() + 1)
        height, width = np.ptp(rows) + 1, np.ptp(columns) + 1
        kind = rng.random()
        if kind < 0.4:  # A table hides everything below its edge.
            hidden[max(top, rows.min() + height // 3) :] = True
        elif kind < 0.7:  # Another person or a pillar hides everything on one side.
            side = rng.random() < 0.5
            hidden[:, : left - width // 4] = side
            hidden[:, left + width // 4 :] = not side
        else:
            hidden[top : top + height // 4 + 1, left : left + width // 3 + 1] = True
    if rng.random() < 0.12:
        hidden |= rng.random(seen.shape) < rng.uniform(0.05, 0.4)
    return hidden
