"""Renders images and true depth of a synthetic room with people, for tests of stereo cameras.

NumPy casts the rays through a second implementation of the lens model, which shares no code with the tested
package. All points are in the left camera's frame (OpenCV's), metres.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import map_coordinates

UNDISTORTING = 10
"""Number of fixed-point iterations. The lenses of the tests are then exact to 1e-4 px."""
GRAIN = (0.008, 0.03, 0.15)
"""Sizes of surface details, metres: cloth, folds, prints."""


@dataclass(frozen=True)
class Lens:
    """A camera of the pair; ``turn`` and ``shift`` transform a point from the left camera's frame to its
    own."""

    width: int
    height: int
    focal: tuple[float, float]
    centre: tuple[float, float]
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def distorted(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Applies Brown-Conrady distortion to normalised coordinates."""
        k1, k2, p1, p2, k3 = self.distortion
        r = x * x + y * y
        radial = 1 + k1 * r + k2 * r**2 + k3 * r**3
        return (
            x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x),
            y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y,
        )

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Returns (..., 2) pixels of (..., 3) points in the left camera's frame."""
        own = points @ self.turn.T + self.shift
        x, y = self.distorted(own[..., 0] / own[..., 2], own[..., 1] / own[..., 2])
        return np.stack([x * self.focal[0] + self.centre[0], y * self.focal[1] + self.centre[1]], -1)

    def rays(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns (3,) the camera position, and (N, 3) the directions of its pixels, in the left camera's
        frame."""
        goal = (u - self.centre[0]) / self.focal[0], (v - self.centre[1]) / self.focal[1]
        x, y = goal
        for _ in range(UNDISTORTING if any(self.distortion) else 0):
            bent = self.distorted(x, y)
            x, y = x + goal[0] - bent[0], y + goal[1] - bent[1]
        looks = np.stack([x, y, np.ones_like(x)], -1)
        return -self.turn.T @ self.shift, looks @ self.turn


@dataclass(frozen=True)
class Plane:
    """An infinite plane."""

    point: tuple[float, float, float]
    normal: tuple[float, float, float]

    def hit(self, eye: np.ndarray, looks: np.ndarray) -> np.ndarray:
        """Returns (N,) distances along the rays, infinite if they miss."""
        slope = looks @ np.array(self.normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            length = (np.array(self.point) - eye) @ np.array(self.normal) / slope
        return np.where(length > 1e-6, length, np.inf)


@dataclass(frozen=True)
class Capsule:
    """A limb: all points within ``radius`` of the line from ``start`` to ``end``."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float

    def hit(self, eye: np.ndarray, looks: np.ndarray) -> np.ndarray:
        """Returns (N,) distances along the rays, infinite if they miss."""
        a, b = np.array(self.start), np.array(self.end)
        axis = b - a
        length = np.linalg.norm(axis)
        axis = axis / length
        across = looks - np.outer(looks @ axis, axis)
        offset = (eye - a) - (eye - a) @ axis * axis
        distance = _nearest((across**2).sum(-1), across @ offset, offset @ offset - self.radius**2)
        along = (eye - a) @ axis + distance * (looks @ axis)
        distance = np.where((along >= 0) & (along <= length), distance, np.inf)
        for end in (a, b):
            middle = eye - end
            ball = _nearest((looks**2).sum(-1), looks @ middle, middle @ middle - self.radius**2)
            distance = np.minimum(distance, ball)
        return distance


def _nearest(a: np.ndarray, half_b: np.ndarray, c: float) -> np.ndarray:
    """Returns the smaller positive root of a t^2 + 2 half_b t + c, infinite if there is none."""
    inside = half_b**2 - a * c
    with np.errstate(divide="ignore", invalid="ignore"):
        root = (-half_b - np.sqrt(np.maximum(inside, 0))) / a
    return np.where((inside > 0) & (root > 1e-6), root, np.inf)


def person(x: float, z: float, floor: float = 1.2) -> list[Capsule]:
    """Returns a person of 1.7 m, standing on a floor ``floor`` metres below the camera, arms half raised."""
    y = floor - 1.7
    limbs = [((0, 1.42, 0), (0, 1.60, 0), 0.10), ((0, 0.98, 0), (0, 1.32, 0), 0.16)]
    for s in (-1, 1):
        limbs += [
            ((0.19 * s, 1.38, 0), (0.42 * s, 1.22, 0.02), 0.05),
            ((0.42 * s, 1.22, 0.02), (0.60 * s, 1.40, -0.10), 0.04),
            ((0.10 * s, 0.95, 0), (0.14 * s, 0.50, -0.02), 0.08),
            ((0.14 * s, 0.50, -0.02), (0.16 * s, 0.08, 0.02), 0.06),
        ]
    place = lambda p: (x + p[0], y + 1.7 - p[1], z + p[2])  # noqa: E731
    return [Capsule(place(a), place(b), r) for a, b, r in limbs]


def room(floor: float = 1.2, wall: float = 4.0) -> list[Plane]:
    """Returns a floor, and a wall at the back."""
    return [Plane((0, floor, 0), (0, -1, 0)), Plane((0, 0, wall), (0, 0, -1))]


class Renderer:
    """Renders surfaces with a random texture each, which looks the same from every side.

    Args:
        things: planes and capsules.
        seed: seed of the textures and of the cameras' noise.
        contrast: grey values, standard deviation of the texture.
    """

    def __init__(self, things: list, seed: int = 0, contrast: float = 30.0) -> None:
        self._things, self._contrast = things, contrast
        self._random = np.random.default_rng(seed)
        self._cells = self._random.standard_normal((64, 64, 64)).astype(np.float32)

    def render_image(
        self, lens: Lens, samples: int = 2, gain: float = 1.0, vignette: float = 0.0, noise: float = 0.0
    ) -> np.ndarray:
        """Returns (H, W) uint8 a camera's image.

        Args:
            samples: rays per pixel along each side.
            gain: exposure factor.
            vignette: fraction of the light that is lost in a corner.
            noise: grey values, standard deviation.
        """
        steps = (np.arange(samples) + 0.5) / samples - 0.5
        u = (np.arange(lens.width)[:, None] + steps).ravel()
        v = (np.arange(lens.height)[:, None] + steps).ravel()
        uu, vv = np.meshgrid(u, v)
        eye, looks = lens.rays(uu.ravel(), vv.ravel())
        length, which = self._hit(eye, looks)
        light = self._light(eye + looks * length[:, None], which)
        light = light.reshape(lens.height, samples, lens.width, samples).mean((1, 3))
        uu, vv = np.meshgrid(np.arange(lens.width), np.arange(lens.height))
        corner = ((uu - lens.centre[0]) ** 2 + (vv - lens.centre[1]) ** 2) / (
            lens.centre[0] ** 2 + lens.centre[1] ** 2
        )
        light = light * gain * (1 - vignette * corner)
        light = light + noise * self._random.standard_normal(light.shape)
        return np.clip(np.rint(light), 0, 255).astype(np.uint8)

    def render_depth(self, lens: Lens) -> np.ndarray:
        """Returns (H, W) metres along the lens's axis."""
        return self.render_hits(lens)[0]

    def render_hits(self, lens: Lens) -> tuple[np.ndarray, np.ndarray]:
        """Returns (H, W) metres along the lens's axis, and (H, W) the object at each pixel."""
        uu, vv = np.meshgrid(np.arange(lens.width), np.arange(lens.height))
        eye, looks = lens.rays(uu.ravel().astype(float), vv.ravel().astype(float))
        length, which = self._hit(eye, looks)
        points = (eye + looks * length[:, None]) @ lens.turn.T + lens.shift
        return points[:, 2].reshape(uu.shape), which.reshape(uu.shape)

    def _hit(self, eye: np.ndarray, looks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns (N,) the distance along each ray to the nearest surface, and (N,) the index of that
        surface.
        """
        lengths = np.stack([thing.hit(eye, looks) for thing in self._things])
        which = lengths.argmin(0)
        return lengths[which, np.arange(len(which))], which

    def _light(self, points: np.ndarray, which: np.ndarray) -> np.ndarray:
        """Returns (N,) grey values of points on surfaces. ``which`` (N,) is the index of each point's
        surface.
        """
        light = np.full(len(points), 110.0)
        is_hit = np.isfinite(points).all(-1)
        place = points[is_hit] + 1.37 * which[is_hit, None]
        for grain in GRAIN:
            turned = place @ _TURN.T / grain
            light[is_hit] += (
                self._contrast
                / np.sqrt(len(GRAIN))
                * map_coordinates(self._cells, turned.T, order=1, mode="grid-wrap")
            )
        return light


_TURN = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
"""Rotates the texture's cells relative to the axes, so that no surface is aligned with the cells."""
