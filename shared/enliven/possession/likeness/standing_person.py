"""Finds the position and heading at which a standing person fits best into a mesh.

The origin of a mesh from a file may be anywhere. A performer at the origin could stand in the seat of a chair
or in the belly of a horse, and attach to few nodes. So the mesh is moved and rotated until all limbs of a
standing figure are as near to its surface as possible.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import Float, Int
from enliven.deformation.graph.sampling import sample_uniform_points
from enliven.meshes import Mesh
from enliven.person import PARENTS, Joint
from enliven.possession.placement import rotation_about_y

_BONE_DISTANCE_M = 0.11
"""Distance from the surface, metres, at which a bone has a third of the score of a bone that touches the
surface."""
_CELL_M = 0.04
"""Grid cell size, metres: a third of ``_BONE_DISTANCE_M``, so that the score of a bone hardly changes
within a cell."""
_YAW_COUNT = 16
"""Number of yaw angles that are tried. They are 22.5 degrees apart, because each requires a pass over all
positions."""
_POINTS_PER_BONE = 5
"""Number of points per bone at which the distance score is looked up. On a lower leg they are at most 9 cm
apart."""
_MAX_PLACES = 700
"""Approximate number of floor positions that are tried. Their spacing is larger for a mesh that is much wider
than high."""
_MAX_CELLS = 300_000
"""Maximum number of grid cells. Cells are larger in a mesh that is much wider than high."""
PERSON_HEIGHT_M = 1.75
"""Height of the reference person, metres: the height of an average person. All lengths in this module are
scaled by the mesh's height divided by this height."""
TRUNK_JOINTS = [Joint.HIP_LEFT, Joint.HIP_RIGHT, Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT]
"""Joints with their mean at the middle of a person's trunk."""
_STANDING_JOINTS = {
    "HIP_CENTER": (0.0, 0.97, 0.0), "SPINE": (0.0, 1.13, -0.01), "SHOULDER_CENTER": (0.0, 1.42, -0.01),
    "HEAD": (0.0, 1.61, 0.02), "HIP_LEFT": (0.09, 0.91, 0.0), "KNEE_LEFT": (0.10, 0.49, 0.02),
    "ANKLE_LEFT": (0.11, 0.08, 0.0), "FOOT_LEFT": (0.12, 0.03, 0.12),
    "SHOULDER_LEFT": (0.17, 1.39, -0.01), "ELBOW_LEFT": (0.22, 1.10, 0.0), "WRIST_LEFT": (0.26, 0.86, 0.06),
    "HAND_LEFT": (0.26, 0.78, 0.08),
}  # fmt: skip
"""Joints of the reference person on the left and in the middle, metres: standing, with hanging arms."""
_PAIRED_BONES = (("KNEE", 1.0), ("ANKLE", 1.0), ("ELBOW", 0.15), ("WRIST", 0.15))
"""Paired bones that are scored, given by their child joint and weight. The score of a pair is twice the score
of its worse bone. Hanging arms have a low weight, because few meshes have a surface there.
"""
_TRUNK_BONES = (("SPINE", 1.0), ("SHOULDER_CENTER", 1.0), ("HEAD", 0.5))
"""Bones of the trunk that are scored, given by their child joint and weight."""
_SURFACE_DISTANCE_M = 0.25
"""Distance from the bones, metres, at which a surface point has a third of the score of a point on a bone."""
_HEAD_AHEAD_GAIN = 0.4
"""Relative gain in score per metre that the head is ahead of the middle. With it, a performer inside a horse
faces in the horse's direction."""
_MASS_AHEAD_GAIN = 0.03
"""Relative gain in score per metre that the mesh's centre is ahead of the person. With it, a performer in the
back of a chair faces the seat. It is far smaller than the gain for a head."""
_MODELLED_YAW_GAIN = 0.004
"""Relative gain in score of the modelled yaw compared with a yaw that differs by a quarter turn. It only
decides between otherwise equal yaws."""
_HEAD_HEIGHT_FRACTION = 0.85
"""Minimum height of the surface that counts as the head, as a fraction of the mesh's height."""
_MIN_HEAD_OFFSET_M = 0.15
"""Minimum horizontal distance, metres, between the head and the middle at which the head indicates the
front."""
_BEHIND_FACTOR = 0.5
"""Factor on distances from points behind the surface. It is below 1, because a bone belongs inside a limb
rather than outside."""
_POINTS_PER_LEAF = 32
"""Number of points per leaf of the k-d tree. With it, queries for a whole grid take three quarters of the
time with SciPy's default."""


def make_standing_figure(height: float = PERSON_HEIGHT_M) -> Float:
    """Returns the joints (20, 3), metres, of a person who stands at the origin, faces +Z and has hanging
    arms.
    """
    joints = np.empty((len(Joint), 3))
    for joint in Joint:
        x, y, z = _STANDING_JOINTS[joint.name.replace("RIGHT", "LEFT")]
        joints[joint] = (-x if "RIGHT" in joint.name else x, y, z)
    return np.asarray(joints * (height / PERSON_HEIGHT_M))


def fit_standing_person(mesh: Mesh) -> tuple[Mesh, float]:
    """Moves a mesh with its lowest point at y = 0, so that a person who stands at the origin and faces +Z
    fits best into it.

    Returns:
        The mesh, and the score of the fit, from 0 (no bone is near the surface) to 1 (every bone is in the
        surface).
    """
    height = float(np.ptp(mesh.vertices[:, 1])) or 1.0
    yaw, offset, score = fit_figures(mesh, [make_standing_figure(height)])
    vertices = (mesh.vertices - offset) @ rotation_about_y(yaw)
    return replace(mesh, vertices=vertices), score


def fit_figures(mesh: Mesh, figures: Sequence[Float]) -> tuple[float, Float, float]:
    """Finds the rotation about +Y and the move over the floor that best fit all figures into a mesh.

    The score combines how near the bones are to the surface and how much of the surface is near to bones. For
    a single figure it also contains the symmetry of the mesh about the figure.

    Args:
        figures: joints (20, 3) of each figure, metres, scaled to the mesh's height, around the origin, facing
            +Z.

    Returns:
        The rotation about +Y (radians), the move (3,) (metres), and the score from 0 to 1.
    """
    unit = (float(np.ptp(mesh.vertices[:, 1])) or 1.0) / PERSON_HEIGHT_M
    samples = sample_uniform_points(mesh, 8000, np.random.default_rng(0))
    points = samples.positions
    # Precompute the proximity grids of the surface and of the figures' bones.
    surface_field = ProximityGrid(points, _BONE_DISTANCE_M * unit, _CELL_M * unit, samples.normals)
    bone_fields = [
        ProximityGrid(_bone_points(figure), _SURFACE_DISTANCE_M * unit, _CELL_M * unit) for figure in figures
    ]
    low, high = mesh.bounds
    # Try the positions of a grid over the floor area of the mesh.
    step = max(1.5 * surface_field.cell, float(np.sqrt((high - low)[0] * (high - low)[2] / _MAX_PLACES)))
    steps = [np.arange(low[a], high[a] + step, step) for a in (0, 2)]
    shifts = np.stack(np.meshgrid(*steps, indexing="ij"), -1).reshape(-1, 2)
    floor = np.insert(shifts, 1, 0.0, axis=1)
    pieces = points[::27]
    own_nearness = float(surface_field.sample_shifted(pieces, np.zeros((1, 3))).mean())
    head = points[points[:, 1] >= low[1] + _HEAD_HEIGHT_FRACTION * (high[1] - low[1])].mean(0)[[0, 2]]
    best_score, stand = -np.inf, (0.0, np.zeros(3), 0.0)
    # For each yaw, score all floor positions at once. The score rewards bones near the surface, surface near
    # the bones, and symmetry.
    for yaw in np.arange(_YAW_COUNT) * (2 * np.pi / _YAW_COUNT):
        rotation_matrix, front = rotation_about_y(yaw), np.array([np.sin(yaw), np.cos(yaw)]) / unit
        scores = np.mean(
            [_figure_scores(surface_field, figure @ rotation_matrix.T, floor) for figure in figures], axis=0
        )
        rotated_pieces, rotated_floor = pieces @ rotation_matrix, -floor @ rotation_matrix
        scores *= np.max(
            [field.sample_shifted(rotated_pieces, rotated_floor) for field in bone_fields], axis=0
        ).mean(1)
        if len(figures) == 1:
            mirror = rotation_matrix @ np.diag([-1.0, 1.0, 1.0]) @ rotation_matrix.T
            mirror_values = surface_field.sample_shifted(pieces @ mirror, floor - floor @ mirror)
            scores *= (mirror_values.mean(1) / own_nearness) ** 2
        # Prefer yaws for which the head of the mesh is ahead or, without a head, its centre. The reported
        # score does not include this preference.
        ahead = (head - shifts) @ front
        ahead = np.sign(ahead) * np.maximum(np.abs(ahead) - _MIN_HEAD_OFFSET_M, 0.0)
        preference = scores + _HEAD_AHEAD_GAIN * scores * ahead
        preference += _MASS_AHEAD_GAIN * scores * ((pieces.mean(0)[[0, 2]] - shifts) @ front)
        preference += _MODELLED_YAW_GAIN * scores * np.cos(yaw)
        top = int(preference.argmax())
        if preference[top] > best_score:
            best_score = float(preference[top])
            stand = float(yaw), np.array([shifts[top, 0], 0.0, shifts[top, 1]]), float(scores[top])
    return stand


def _bone_points(joints: Float) -> Float:
    """Returns points (P, 3) along all scored bones of the joints (20, 3)."""
    along = np.linspace(0.0, 1.0, 8)[:, None, None]
    ends, starts = joints[1:], joints[list(PARENTS[1:])]
    return np.asarray((starts * (1 - along) + ends * along).reshape(-1, 3))


class ProximityGrid:
    """A grid of nearness values exp(-(d / near)^2), in which d is the distance to the nearest of the given
    points.

    If the points have ``normals``, distances behind them are shortened, because a spine belongs inside a
    trunk.
    """

    def __init__(self, points: Float, near: float, cell: float, normals: Float | None = None) -> None:
        low, high = points.min(0), points.max(0)
        self.cell = cell = max(cell, float(np.cbrt(np.prod(high - low + 6 * near) / _MAX_CELLS)))
        self._low = low - 3 * near
        shape = np.ceil((high - low + 6 * near) / cell).astype(int) + 1
        axes = [self._low[a] + cell * np.arange(shape[a]) for a in range(3)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
        grid = grid.reshape(-1, 3)
        # Import SciPy here, because characters that already fit do not need it.
        from scipy.spatial import cKDTree

        length, nearest = cKDTree(points, leafsize=_POINTS_PER_LEAF).query(
            grid, distance_upper_bound=4 * near
        )
        if normals is not None:
            nearest_index = np.minimum(nearest, len(points) - 1)
            is_behind = np.einsum("gi,gi->g", grid - points[nearest_index], normals[nearest_index]) < 0
            length = np.where(is_behind, _BEHIND_FACTOR * length, length)
        # Add a border of zeros, so that the lookup of every point outside the grid gives zero.
        self._values = np.pad(np.exp(-((length / near) ** 2)).reshape(shape), 1)

    def sample_shifted(self, points: Float, shifts: Float) -> Float:
        """Returns the nearness (S, P) at points (P, 3) that are moved by shifts (S, 3) over the floor. It is
        0 outside the grid.
        """
        cell_index: Int = np.zeros((), np.int64)
        for axis, size in enumerate(self._values.shape):
            cell_coordinate = (points[:, axis] - self._low[axis]) / self.cell
            shifted = cell_coordinate if axis == 1 else cell_coordinate + shifts[:, axis, None] / self.cell
            cell_index = cell_index * size + np.clip(np.rint(shifted) + 1, 0, size - 1).astype(np.int64)
        return np.asarray(self._values.ravel()[cell_index])


def _figure_scores(near: ProximityGrid, joints: Float, shifts: Float) -> Float:
    """Returns the scores (S,) of a figure with joints (20, 3) that is moved by each of the shifts (S, 3),
    metres, over the floor.
    """

    def bone(name: str) -> Float:
        child = Joint[name]
        along = (np.arange(_POINTS_PER_BONE) + 0.5)[:, None] / _POINTS_PER_BONE
        points = joints[PARENTS[child]] * (1 - along) + joints[child] * along
        return np.asarray(near.sample_shifted(points, shifts).mean(1))

    total = np.zeros(len(shifts))
    for name, weight in _PAIRED_BONES:
        total += 2 * weight * np.minimum(bone(f"{name}_LEFT"), bone(f"{name}_RIGHT"))
    for name, weight in _TRUNK_BONES:
        total += weight * bone(name)
    return np.asarray(total / (2 * sum(w for _, w in _PAIRED_BONES) + sum(w for _, w in _TRUNK_BONES)))
