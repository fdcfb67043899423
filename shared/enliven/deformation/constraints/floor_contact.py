"""Floor contact and foot lock: no part of the mesh sinks into the floor, and a standing foot does not slide.

There are two methods. The first method raises the whole mesh by the depth of its lowest point, which keeps
its shape and never jumps. The second method bends only the parts that would sink, by planes. But a straight
leg that is pushed up from below can bend to either side, and may switch sides from one frame to the next. So
the second method suits soft or hanging meshes, and the first method suits meshes that stand on stiff legs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from enliven.arrays import Float, Int
from enliven.deformation.constraints.planes import PlaneConstraints
from enliven.deformation.constraints.soft import ConstrainedPoints, join_planes, subsample_on_grid
from enliven.deformation.graph.connectivity import label_components
from enliven.document import Character
from enliven.settings import parameter, setting

_FEET_SAMPLE_COUNT = 96
"""Number of points that are sampled on all feet together."""
_BODY_SAMPLE_COUNT = 160
"""Number of points that are sampled on the rest of the mesh."""
_FOOT_HEIGHT_FRACTION = 0.04
"""Maximum height of a vertex of a foot, as a fraction of the mesh's height."""


@dataclass(frozen=True)
class FloorSettings:
    """Settings of floor contact and foot lock; lengths are fractions of the mesh's height."""

    use: Literal["off", "raised", "above", "stand"] = setting(
        "off",
        "'raised': lifts the whole mesh if it would sink into the floor. 'above': bends the "
        "parts that would sink. 'stand': also locks standing feet.",
    )
    touch: float = parameter(
        0.02,
        "Maximum height of a standing foot above the floor, as a fraction of the mesh's height.",
        low=0.0,
        high=1.0,
    )
    still: float = parameter(
        0.12, "Maximum speed of a standing foot, in mesh heights per second.", low=0.0, high=10.0
    )
    dwell: float = parameter(
        0.1,
        "Time for which a foot must be low and slow before it is locked.",
        unit="s",
        low=0.0,
        high=10.0,
    )
    give: float = parameter(
        0.08,
        "Displacement at which a locked foot is released, as a fraction of the mesh's height.",
        low=0.0,
        high=1.0,
    )
    ease: float = parameter(
        0.2, "Duration of the transition when a foot is locked or released.", unit="s", low=0.0, high=10.0
    )
    weight: float = parameter(
        50.0, "Weight of the floor constraint, as a factor on embedded.planes.", low=0.0, high=1000.0
    )


@dataclass
class Foot:
    """A foot of a mesh, and its contact with the floor.

    Attributes:
        points: indices of the foot's points among all points of the soles.
        contact_points: (P, 2) metres, x and z of its points when the foot started to stand. None if it does
            not stand.
        nodes_at_contact: (N, 2) metres, x and z of all nodes when the foot started to stand.
        lock_strength: 0..1, the strength of the lock. During a release, it falls as the foot moves to
            ``free_points``.
        free_points: (P, 2) metres, x and z of its points if they only followed the motion of the whole mesh.
        still_seconds: seconds since the foot stopped moving.
        last: (P, 3) metres, positions of its points in the last frame.
    """

    points: Int
    contact_points: Float | None = None
    nodes_at_contact: Float | None = None
    lock_strength: float = 0.0
    still_seconds: float = 0.0
    last: Float | None = None
    free_points: Float | None = None
    is_released: bool = False


class FloorContact:
    """The contact of one mesh with the floor, in the mesh's rest space."""

    def __init__(self, character: Character, settings: FloorSettings | None = None) -> None:
        self.settings = settings or FloorSettings()
        heights = character.vertices[:, 1].astype(np.float64)
        self.height = float(np.ptp(heights)) or 1.0
        low_vertices = np.flatnonzero(heights < heights.min() + _FOOT_HEIGHT_FRACTION * self.height)
        soles = low_vertices[subsample_on_grid(character.vertices[low_vertices], _FEET_SAMPLE_COUNT)]
        body_samples = subsample_on_grid(character.vertices, _BODY_SAMPLE_COUNT)
        self.soles = ConstrainedPoints.from_vertices(character, soles)
        self._all = ConstrainedPoints.from_vertices(
            character, np.concatenate([soles, np.setdiff1d(body_samples, soles)])
        )
        self._lowest = float(heights.min())
        groups = _point_clusters(self.soles.at, 2.0 * _FOOT_HEIGHT_FRACTION * self.height)
        self.feet = [Foot(group) for group in groups]
        node_heights = self.soles.pivots[:, 1]
        upper_nodes = np.flatnonzero(node_heights > self._lowest + 0.4 * self.height)
        self._upper = upper_nodes if len(upper_nodes) > 2 else np.arange(len(node_heights))

    def reset(self) -> None:
        """Releases all feet, because the mesh was placed elsewhere."""
        self.feet = [Foot(foot.points) for foot in self.feet]

    def raise_above_floor(self, linear: Float, positions: Float, floor: float = 0.0) -> Float:
        """Returns the nodes' positions (N, 3) in metres, raised together until no point is below the floor.

        The arguments are those of :meth:`planes`.
        """
        lowest = float(self._all.deform_points(linear, positions)[:, 1].min())
        return np.asarray(positions + np.array([0.0, max(min(floor, self._lowest) - lowest, 0.0), 0.0]))

    def planes(
        self, linear: Float, positions: Float, seconds: float, floor: float = 0.0
    ) -> PlaneConstraints | None:
        """Returns the planes of the floor contact and of locked feet for the current pose of the mesh.
        Returns None if nothing touches the floor.

        Args:
            linear: (N, 3, 3) the nodes' current linear parts.
            positions: (N, 3) metres, the nodes' current positions.
            seconds: seconds since the last call.
            floor: height of the floor in the rest space, metres.
        """
        settings = self.settings
        floor = min(floor, self._lowest)
        points = self._all.deform_points(linear, positions)
        is_low = points[:, 1] < floor + 0.1 * self.height
        # If one foot is near the floor, keep the planes of all feet. A foot that the floor has pushed high up
        # would otherwise lose its plane for a frame and fall through the floor.
        is_low[: len(self.soles)] |= is_low.any()
        near_points = np.flatnonzero(is_low)
        up = np.tile([0.0, 1.0, 0.0], (len(near_points), 1))
        sets = [self._all.create_planes(near_points, up, floor, settings.weight, True)]
        if settings.use == "stand":
            for foot in self.feet:
                self._update_foot_state(
                    foot, points[foot.points], positions[self._upper][:, [0, 2]], seconds, floor
                )
            sets += [
                planes
                for foot in self.feet
                if foot.lock_strength > 0
                for planes in self._foot_lock_planes(foot)
            ]
        return join_planes(sets)

    def _update_foot_state(
        self, foot: Foot, points: Float, upper_nodes: Float, seconds: float, floor: float
    ) -> None:
        """Updates the contact of a foot, given its points (P, 3), and x and z of the upper nodes (M, 2), in
        metres."""
        settings, height = self.settings, self.height
        speed = np.inf
        if foot.last is not None and seconds > 0:
            speed = float(np.linalg.norm((points - foot.last).mean(0))) / seconds
        foot.last = points
        is_down = points[:, 1].min() < floor + settings.touch * height
        if foot.contact_points is not None and foot.nodes_at_contact is not None:
            foot.free_points = _carry_points(foot.nodes_at_contact, upper_nodes, foot.contact_points)
            is_far = (
                float(np.linalg.norm((foot.free_points - foot.contact_points).mean(0)))
                > settings.give * height
            )
            foot.is_released = foot.is_released or not is_down or is_far
        step = seconds / settings.ease if settings.ease > 0 else 1.0
        if foot.contact_points is None:
            foot.still_seconds = (
                foot.still_seconds + seconds if is_down and speed < settings.still * height else 0.0
            )
            if foot.still_seconds > settings.dwell:
                foot.contact_points, foot.nodes_at_contact = points[:, [0, 2]].copy(), upper_nodes
                foot.lock_strength, foot.is_released = min(step, 1.0), False
        else:
            foot.lock_strength = (
                max(0.0, foot.lock_strength - step)
                if foot.is_released
                else min(1.0, foot.lock_strength + step)
            )
            if foot.lock_strength == 0.0:
                foot.contact_points, foot.nodes_at_contact, foot.still_seconds = None, None, 0.0

    def _foot_lock_planes(self, foot: Foot) -> list[PlaneConstraints]:
        """Returns planes perpendicular to x and z that lock a foot in place, or that move it towards
        ``free_points`` while it is released.
        """
        assert foot.contact_points is not None
        weight, places = self.settings.weight * foot.lock_strength**4, foot.contact_points
        if foot.is_released and foot.free_points is not None:
            release = 1.0 - foot.lock_strength
            release = release * release * (3 - 2 * release)
            weight = self.settings.weight * foot.lock_strength**2
            places = places + release * (foot.free_points - places)
        count = len(foot.points)
        return [
            self.soles.create_planes(foot.points, np.tile(axis, (count, 1)), places[:, k], weight, False)
            for k, axis in enumerate(([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]))
        ]


def _carry_points(start: Float, end: Float, points: Float) -> Float:
    """Fits the rigid motion over the floor that best moves ``start`` to ``end`` (M, 2) (Procrustes), and
    applies it to ``points`` (P, 2)."""
    start_offsets, end_offsets = start - start.mean(0), end - end.mean(0)
    cosine, sine = (
        float((start_offsets * end_offsets).sum()),
        float((start_offsets[:, 0] * end_offsets[:, 1] - start_offsets[:, 1] * end_offsets[:, 0]).sum()),
    )
    length = np.hypot(cosine, sine)
    c, s = (cosine / length, sine / length) if length > 1e-12 else (1.0, 0.0)
    return np.asarray((points - start.mean(0)) @ np.array([[c, s], [-s, c]]) + end.mean(0))


def _point_clusters(points: Float, gap: float) -> list[Int]:
    """Returns clusters of points (P, 3), as indices. Horizontal gaps within a cluster are at most ``gap``
    metres."""
    distances = np.linalg.norm(points[:, None, [0, 2]] - points[None][:, :, [0, 2]], axis=2)
    label = label_components(len(points), np.argwhere(distances < gap))
    return [np.flatnonzero(label == k) for k in range(label.max(initial=-1) + 1)]
