"""Surfaces that cut a mesh: a plane, or a stroke on the screen swept along the viewing direction.

A cutting surface is given by a scalar field over space (negative on the near side, positive on the far side),
and by two coordinates on the surface. Caps are triangulated in these coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from enliven.arrays import Bool, Float
from enliven.errors import InputError


class CutSurface(Protocol):
    """The protocol of a surface that cuts a mesh."""

    def compute_distances(self, points: Float) -> Float:
        """Returns (N,) signed distances of points (N, 3): positive on the far side, negative on the near
        side."""
        ...

    def compute_coordinates(self, points: Float) -> Float:
        """Returns (N, 2) coordinates on the surface, approximately in metres."""
        ...

    def covers(self, points: Float) -> Bool:
        """Returns (N,) True for points on the cutting surface that are within its drawn part."""
        ...


@dataclass(frozen=True, eq=False)
class PlaneCut(CutSurface):
    """A cutting plane. The normal points to the far side. The near side is behind the plane.

    Attributes:
        point: (3,) metres, a point of the plane.
        normal: (3,) the normal, of any length above zero.
        reach: radius in metres around ``point`` within which the plane counts as drawn.
    """

    point: Float
    normal: Float
    reach: float = np.inf

    def __post_init__(self) -> None:
        normal = np.array(self.normal, np.float64)
        length = float(np.linalg.norm(normal))
        if not (np.isfinite(length) and length > 0 and np.isfinite(self.point).all()):
            raise InputError(
                "the normal of the cutting plane is 0 or not finite",
                where="cut",
                remedy="Pass a point and a normal vector that is not 0.",
            )
        object.__setattr__(self, "point", np.array(self.point, np.float64))
        object.__setattr__(self, "normal", normal / length)

    def compute_distances(self, points: Float) -> Float:
        """Returns (N,) distances in metres along the normal from the plane to points (N, 3)."""
        return np.asarray((points - self.point) @ self.normal)

    def compute_coordinates(self, points: Float) -> Float:
        """Returns (N, 2) metres along two perpendicular axes in the plane, with the origin at ``point``."""
        across = np.cross(self.normal, np.eye(3)[np.argmin(np.abs(self.normal))])
        across /= np.linalg.norm(across)
        axes = np.stack([across, np.cross(self.normal, across)])
        return np.asarray((points - self.point) @ axes.T)

    def covers(self, points: Float) -> Bool:
        """Returns (N,) True for points (N, 3) with a projection at most ``reach`` away from ``point``."""
        return np.asarray(np.linalg.norm(self.compute_coordinates(points), axis=1) <= self.reach)


@dataclass(frozen=True, eq=False)
class StrokeCut(CutSurface):
    """A stroke on the image, swept along the viewing direction and extended straight beyond both ends.

    Attributes:
        stroke: (S, 2) points in any units of the image (pixels, or -1..1), with the y axis up. The far side
            is on the left in the direction of the stroke.
        picture_from_world: (4, 4) the projection: x and y in the units of the stroke, after division by w.
    """

    stroke: Float
    picture_from_world: Float

    def __post_init__(self) -> None:
        stroke = np.array(self.stroke, np.float64).reshape(-1, 2)
        if not np.isfinite(stroke).all():
            raise InputError(
                "the positions of the stroke are not finite numbers",
                where="cut",
                remedy="Draw the stroke again.",
            )
        step = np.linalg.norm(np.diff(stroke, axis=0), axis=1)
        extent = float(np.ptp(stroke, axis=0).max()) if len(stroke) else 0.0
        stroke = stroke[np.concatenate([[True], step > 1e-3 * extent])] if len(stroke) else stroke
        if len(stroke) < 2:
            raise InputError(
                "the stroke is a single point",
                where="cut",
                remedy="Draw the stroke across the part that you want to cut.",
            )
        object.__setattr__(self, "stroke", stroke)
        object.__setattr__(self, "picture_from_world", np.array(self.picture_from_world, np.float64))

    def compute_distances(self, points: Float) -> Float:
        """Returns (N,) distances from the stroke to the images of points (N, 3), in units of the stroke.

        They are positive on the left of the stroke.
        """
        return self._stroke_coordinates(points)[1]

    def compute_coordinates(self, points: Float) -> Float:
        """Returns (N, 2): position along the stroke and position along the viewing direction.

        Both are approximately metres, because the stroke is scaled at the median depth of the points.
        """
        if len(points) == 0:
            return np.zeros((0, 2))
        along, _, depth = self._stroke_coordinates(points)
        # Compute the metres per unit of the image at this depth, so that both coordinates are approximately
        # metres.
        rows = self.picture_from_world
        unit = float(np.median(depth)) / np.linalg.norm(rows[0, :3])
        ahead = rows[3, :3] if np.any(rows[3, :3]) else np.cross(rows[0, :3], rows[1, :3])
        return np.stack([along * unit, points @ (ahead / np.linalg.norm(ahead))], 1)

    def covers(self, points: Float) -> Bool:
        """Returns (N,) True for points (N, 3) with an image between both ends of the stroke, without its
        extensions.
        """
        along = self._stroke_coordinates(points)[0]
        return np.asarray((along >= 0) & (along <= _arc_lengths(self.stroke)[-1]))

    def _stroke_coordinates(self, points: Float) -> tuple[Float, Float, Float]:
        """Returns for each point (N,) the arc length on the stroke, the distance to the left of it, and the
        depth w."""
        projected = points @ self.picture_from_world[:, :3].T + self.picture_from_world[:, 3]
        depth = projected[:, 3]
        shown = projected[:, :2] / np.where(depth > 1e-9, depth, 1e-9)[:, None]
        along, left = _find_nearest_on_stroke(self.stroke, shown)
        return along, left, depth


def _arc_lengths(stroke: Float) -> Float:
    """Returns the arc length (S,) from the start of a stroke (S, 2) to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(stroke, axis=0), axis=1))])


def _find_nearest_on_stroke(stroke: Float, points: Float) -> tuple[Float, Float]:
    """Returns (N,) arc length of the nearest point on the extended stroke, and (N,) the distance to its
    left."""
    starts, vectors = stroke[:-1], np.diff(stroke, axis=0)
    lengths = np.linalg.norm(vectors, axis=1)
    units = vectors / lengths[:, None]
    away = points[:, None] - starts[None]
    along = (away * units[None]).sum(2)
    low = np.zeros(len(lengths))
    high = lengths.copy()
    low[0], high[-1] = -np.inf, np.inf
    clamped = np.clip(along, low, high)
    rest = away - clamped[..., None] * units[None]
    distance = np.linalg.norm(rest, axis=2)
    cross = units[None, :, 0] * away[..., 1] - units[None, :, 1] * away[..., 0]
    # At a corner of the stroke, two segments are equally near. The segment that is more perpendicular to the
    # offset decides the side.
    square = np.abs(cross) / np.maximum(distance, 1e-300)
    least = distance.min(1, keepdims=True)
    best = np.argmax(np.where(distance <= least * (1 + 1e-9) + 1e-300, square, -1.0), axis=1)
    rows = np.arange(len(points))
    side = np.where(cross[rows, best] >= 0, 1.0, -1.0)
    return _arc_lengths(stroke)[best] + clamped[rows, best], side * distance[rows, best]
