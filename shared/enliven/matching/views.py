"""Projects a skeleton onto the screen, and finds the view that shows the most bone length."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Bool, Float
from enliven.errors import InputError

MIN_DEPTH_M = 1e-3
"""Near plane of the projection in metres. Points that are nearer, or behind the eye, are projected at
this distance."""


def _float_vector(*values: float) -> Float:
    return np.array(values, np.float64)


@dataclass(frozen=True, eq=False)
class ScreenView:
    """The view for the projection of a skeleton: a direction, an up vector and, for perspective, an eye.

    If a performer acts as in front of a mirror, the view of the performer is opposite to the sensor's view:
    left and right are exchanged.

    Attributes:
        direction: (3,) from the eye into the scene, of any length.
        up: (3,) the up direction on the screen. Its component along ``direction`` is ignored.
        eye: (3,) metres, position of the eye of a perspective view. None for an orthographic view.
        frame: (3, 3) the directions right, up and forward as unit vectors in the world, computed from the
            other attributes.

    Raises:
        InputError: if ``direction`` is zero, or parallel to ``up``.
    """

    direction: Float = field(default_factory=lambda: _float_vector(0.0, 0.0, -1.0))
    up: Float = field(default_factory=lambda: _float_vector(0.0, 1.0, 0.0))
    eye: Float | None = None
    frame: Float = field(init=False)

    def __post_init__(self) -> None:
        forward, up = np.array(self.direction, np.float64), np.array(self.up, np.float64)
        length = float(np.linalg.norm(forward))
        right = np.cross(forward, up)
        right_length = float(np.linalg.norm(right))
        if not np.isfinite(right_length) or right_length <= 1e-9 * length * float(np.linalg.norm(up)):
            remedy = (
                "Pass a direction that is not zero, and an up vector that is not parallel to the direction."
            )
            raise InputError(
                f"the direction {self.direction} and the up vector {self.up} define no view",
                where="view",
                remedy=remedy,
            )
        forward, right = forward / length, right / right_length
        object.__setattr__(self, "direction", forward)
        object.__setattr__(self, "up", np.cross(right, forward))
        object.__setattr__(self, "frame", np.stack([right, self.up, forward]))
        if self.eye is not None:
            object.__setattr__(self, "eye", np.array(self.eye, np.float64))

    @property
    def axes(self) -> Float:
        """(2, 3) the screen's right and up directions as unit vectors in the world."""
        return self.frame[:2]

    def project(self, points: Float) -> Float:
        """Projects points (..., 3) in metres to coordinates (..., 2) right and up on the screen.

        The unit is metres for an orthographic view. For a perspective view it is metres at distance one.
        """
        if self.eye is None:
            return np.asarray(points @ self.axes.T)
        return np.asarray((points - self.eye) @ self.axes.T / self.depths(points)[..., None])

    def depths(self, points: Float) -> Float:
        """Returns the depth (...,) of points (..., 3) in metres, or 1 for an orthographic view."""
        if self.eye is None:
            return np.ones(points.shape[:-1])
        return np.asarray(np.maximum((points - self.eye) @ self.direction, MIN_DEPTH_M))


def is_end_on(vectors: Float, view: ScreenView, fraction: float = 0.2) -> Bool:
    """Returns (N,) True for those of ``vectors`` (N, 3) that point so nearly at the eye that the direction of
    their projection is unreliable.

    Args:
        fraction: minimum visible fraction of a vector's length.
    """
    projected = np.linalg.norm(vectors @ view.axes.T, axis=1)
    lengths = np.linalg.norm(vectors, axis=1)
    return np.asarray((projected < fraction * lengths) & (lengths > 0.0))


def compute_projected_length(vectors: Float, direction: Float) -> float:
    """Returns the sum of the lengths of ``vectors`` (N, 3) after projection along a unit direction."""
    along = vectors @ direction
    return float(np.sqrt(np.maximum((vectors**2).sum(1) - along**2, 0.0)).sum())


def find_best_view(
    vectors: Float, view: ScreenView, most_turn: float = np.pi / 2, steps: int = 60
) -> ScreenView:
    """Finds the view that shows most bone length: the largest sum of projections (AniMesh, section 8).

    The sum of *squared* lengths is largest along the eigenvector of the smallest eigenvalue of the scatter
    sum(v v^T). The search starts at this direction, at the current direction, and at the other eigenvectors.
    From each start, it increases the sum of lengths, sum sqrt(|v|^2 - (v.d)^2), iteratively on the sphere.
    Each step maximizes a quadratic lower bound (iteratively reweighted scatter), so the sum never decreases.

    Args:
        vectors: (N, 3) metres, the vectors of the bones from parent joint to joint.
        view: the current view. Its up vector is kept as far as possible.
        most_turn: maximum angle from the current direction in radians. pi / 2 covers all views, since a view
            from behind shows the same amount.
        steps: maximum number of refinement steps.

    Returns:
        An orthographic view. The caller must set the eye of a perspective view.
    """
    lengths = np.linalg.norm(vectors, axis=1)
    vectors = vectors[lengths > 0.0]
    if not len(vectors):
        return view
    starts = [view.direction, *np.linalg.eigh(vectors.T @ vectors)[1].T]
    directions = [_refine_direction(vectors, start, view.direction, most_turn, steps) for start in starts]
    best = max(directions, key=lambda d: round(compute_projected_length(vectors, d), 9))
    return _view_along(best, view)


def _refine_direction(vectors: Float, start: Float, current: Float, most_turn: float, steps: int) -> Float:
    """Refines a unit direction, at most ``most_turn`` from ``current``, until no step shows more bone
    length."""
    squares = (vectors**2).sum(1)
    direction = _limit_direction(start, current, most_turn)
    sum_of_lengths = compute_projected_length(vectors, direction)
    for _ in range(steps):
        projected = np.sqrt(np.maximum(squares - (vectors @ direction) ** 2, 1e-12 * squares))
        # sqrt is concave, so sum sqrt(x) <= sum sqrt(x0) + (x - x0) / (2 sqrt(x0)), with equality at x = x0.
        # Maximise this bound.
        scatter = vectors.T @ (vectors / projected[:, None])
        next_direction = _limit_direction(np.linalg.eigh(scatter)[1][:, 0], direction, np.pi / 2)
        best_direction, best_value = _find_best_between(
            vectors, direction, next_direction, current, most_turn
        )
        if best_value <= sum_of_lengths * (1.0 + 1e-12):
            break
        direction, sum_of_lengths = best_direction, best_value
    return direction


def _find_best_between(
    vectors: Float, start: Float, end: Float, current: Float, most_turn: float
) -> tuple[Float, float]:
    """Tries four directions between two directions. Returns the best, and its sum of projected lengths."""
    candidates = [
        _limit_direction(start + fraction * (end - start), current, most_turn)
        for fraction in (1.0, 0.5, 0.2, 0.05)
    ]
    values = [compute_projected_length(vectors, direction) for direction in candidates]
    best = int(np.argmax(values))
    return candidates[best], values[best]


def _limit_direction(direction: Float, current: Float, most_turn: float) -> Float:
    """Returns the unit direction, or its opposite, limited to the angle ``most_turn`` from the current
    one."""
    direction = direction / np.linalg.norm(direction)
    if direction @ current < 0.0:
        direction = -direction
    angle = float(np.arccos(np.clip(direction @ current, -1.0, 1.0)))
    if angle <= most_turn:
        return np.asarray(direction)
    perpendicular = direction - (direction @ current) * current
    perpendicular /= np.linalg.norm(perpendicular)
    return np.asarray(np.cos(most_turn) * current + np.sin(most_turn) * perpendicular)


def _view_along(direction: Float, view: ScreenView) -> ScreenView:
    """Returns the view along another direction, with the up vector changed as little as possible."""
    up = view.up
    if abs(float(direction @ up)) > 1.0 - 1e-9:
        up = view.direction * -np.sign(direction @ up)
    return ScreenView(direction, up)
