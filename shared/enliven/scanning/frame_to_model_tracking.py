"""Visual odometry, frame to model: aligns a depth image with the surface that was fused before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.kernels import run_in_pieces
from enliven.scanning.depth_view import DepthView
from enliven.scanning.icp import (
    BIN_COUNT,
    MAX_CHORD,
    MOMENT_COUNT,
    SQUARE_COUNT,
    SUM_COUNT,
    accumulate_normal_equations,
)
from enliven.scanning.rigid import cross_matrix, move_pose
from enliven.scanning.settings import TrackingSettings
from enliven.scanning.tsdf_volume import TsdfVolume

_MAX_COARSE_STEPS = 6
"""Maximum number of Gauss-Newton steps in each coarse volume."""
_MAX_FINE_STEPS = 5
"""Maximum number of Gauss-Newton steps in the finest volume."""
_MIN_ALIGNMENT_STEP = 3e-4
"""The alignment stops when a step is smaller than this, in metres and radians."""
_MAX_EXACT_STEPS = 15
"""Maximum number of steps of ``align_closely``, which is used if the normal alignment leaves the camera pose
uncertain."""
_COARSE_STRIDE_PX = 4
"""Step between sample points in the coarse volumes, in pixels of the half-size image."""
ROBUST_WIDTH_VOXELS = 2.0
"""Width of the robust weight function, in voxels. A point at this distance from the surface has a quarter of
the full weight."""
_GRAVITY_WEIGHT_M2 = 0.1
"""Weight of the up direction from the accelerometer, in squared metres."""
_DAMPING = 1e-6
"""Damping of the normal matrix, relative to the total weight of the points."""

_ROWS_PER_PIECE = 16
"""Rows of points that a thread processes at a time."""
_MIN_INFORMATION = 1e-6
"""Information (inverse variance, 1/m^2) below which a direction counts as unobserved. It corresponds to a
standard deviation of one kilometre."""
_MIN_SIGNAL_FRACTION = 0.5
"""Minimum fraction of the normal matrix that counts as signal rather than noise in a step of
``align_closely``. It limits the step to twice the Gauss-Newton step, because a longer step may oscillate."""
_UPPER_INDICES = np.triu_indices(6)
"""Row and column indices of the upper triangle (21 elements) of a 6 x 6 normal matrix."""


@dataclass(frozen=True)
class Alignment:
    """A camera pose and its uncertainty.

    Attributes:
        world_from_camera: (4, 4) the camera's pose.
        agreeing: fraction, 0 to 1, of the points in observed space that lie on the fused surface.
        overlap: fraction of the image's points that lie in observed space.
        error: weighted root mean square of the distances between points and surface, metres.
        information: (6, 6) inverse covariance of a translation (m) and a rotation (rad) about the camera,
            world axes.
    """

    world_from_camera: Float
    agreeing: float
    overlap: float
    error: float
    information: Float = field(repr=False)

    @property
    def covariance(self) -> Float:
        """(6, 6) covariance of a translation (m) and a rotation (rad); very large along directions that the
        image does not constrain.
        """
        values, vectors = np.linalg.eigh(self.information)
        return np.asarray((vectors / np.maximum(values, _MIN_INFORMATION)) @ vectors.T)

    @property
    def deviation(self) -> float:
        """Standard deviation of the position along its least certain direction, metres."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:3, :3])[-1]))


class CameraTracker:
    """Estimates the camera's pose by Gauss-Newton on the distances of its points to the surface, coarse to
    fine.

    No surface is rendered and no pixel is matched, unlike in ICP with projective data association. The
    residual is the volume's own signed distance at a point, and its gradient is the normal (Bylow et al.,
    "Real-time camera tracking and 3D reconstruction using signed distance functions", RSS 2013). Coarse
    volumes have wide truncation bands, so that distant poses converge.

    Args:
        volumes: the TSDF volumes, from the finest to the coarsest.
    """

    def __init__(self, volumes: Sequence[TsdfVolume], settings: TrackingSettings | None = None) -> None:
        self.volumes, self.settings = list(volumes), settings or TrackingSettings()

    def align(self, view: DepthView, start: Float, up: Float | None = None, coarsest: int = 1) -> Alignment:
        """Returns the pose near ``start`` (4, 4) at which the image fits best.

        Args:
            up: (3,) unit vector, camera frame, that points up according to an accelerometer, or None.
            coarsest: index of the first volume to use; 0 is the finest.
        """
        pose = start.copy()
        for level in range(min(coarsest, len(self.volumes) - 1), -1, -1):
            for _ in range(_MAX_COARSE_STEPS if level else _MAX_FINE_STEPS):
                move = self._gauss_newton_step(self.compute_normal_equations(view, pose, level), pose, up)
                pose = move_pose(pose, move)
                if np.linalg.norm(move) < _MIN_ALIGNMENT_STEP:
                    break
        return self.evaluate(view, pose)

    def align_closely(self, view: DepthView, start: Float, up: Float | None = None) -> Alignment:
        """Returns the pose near ``start`` (4, 4) at which the image fits best. Use this method if noise hides
        the signal.

        On a floor with a small object on it, the noise of the slopes outweighs the information in the object.
        Steps are then too short, and the information seems to be zero. Products of the surface's slopes and
        the image's normals have independent noise and avoid this bias (instrumental variables: Fuller,
        Measurement Error Models, 1987, section 1.4). This method takes more steps, each slightly longer.
        """
        pose = start.copy()
        for _ in range(_MAX_EXACT_STEPS):
            sums = self.compute_normal_equations(view, pose, 0, closely=True)
            move = self._gauss_newton_step(sums, pose, up, _normal_matrix(sums[SQUARE_COUNT + 1 :]))
            pose = move_pose(pose, move)
            if np.linalg.norm(move) < _MIN_ALIGNMENT_STEP:
                break
        sums = self.compute_normal_equations(view, pose, 0, closely=True)
        return self._alignment_for(sums, pose, denoise_close_matrix(sums, self.settings.independent))

    def evaluate(self, view: DepthView, pose: Float) -> Alignment:
        """Evaluates a given pose: returns it with its fit, error and information."""
        sums = self.compute_normal_equations(view, pose, 0)
        return self._alignment_for(sums, pose, denoise_matrix(sums))

    def _alignment_for(self, sums: Float, pose: Float, true_matrix: Float) -> Alignment:
        """Returns the alignment for the sums (SUMS,) at a pose. ``true_matrix`` (6, 6) is the normal matrix
        without noise.
        """
        weight = max(sums[28], 1e-12)
        error = float(np.sqrt(sums[27] / weight))
        # Count only independent pixels, because neighbouring pixels share the same noise, and the error of
        # the model is the same for all of them.
        independent = self.settings.independent / max(error, 1e-4) ** 2
        information = true_matrix * independent
        agreeing, overlap = sums[29] / max(sums[31], 1e-12), sums[31] / max(sums[30], 1e-12)
        return Alignment(pose, float(agreeing), float(overlap), error, information)

    def compute_normal_equations(
        self, view: DepthView, pose: Float, level: int, *, closely: bool = False
    ) -> Float:
        """Returns the (SUMS,) sums of the normal equations over all points, as described at ``SUM_COUNT``.
        Each point uses the finest volume that covers its depth, starting with volume ``level``.
        """
        total = np.zeros(SUM_COUNT)
        stride = self.settings.fine_stride if level == 0 else _COARSE_STRIDE_PX
        nearest = 0.0
        for index in range(level, len(self.volumes)):
            volume = self.volumes[index]
            if volume.reach <= nearest:
                continue
            span = np.array([nearest, volume.reach if index + 1 < len(self.volumes) else np.inf])
            nearest = volume.reach
            rows = -(-view.points.shape[0] // stride)
            sums = np.empty((rows, SUM_COUNT))
            run_in_pieces(
                accumulate_normal_equations, rows, _ROWS_PER_PIECE, view.point_arrays, stride, span, pose,
                ROBUST_WIDTH_VOXELS * volume.band.voxel, volume.field, closely, sums,
            )  # fmt: skip
            total += sums.sum(0)
        return total

    def _gauss_newton_step(
        self, sums: Float, pose: Float, up: Float | None, noise_free: Float | None = None
    ) -> Float:
        """Returns the translation and the rotation of a Gauss-Newton step, (6,).

        Args:
            noise_free: (6, 6) the normal matrix without noise, or None if it is unknown. If it is given, each
                step is divided by the fraction of the normal matrix that is signal.
        """
        matrix, gradient = _normal_matrix(sums), sums[21:27].copy()
        scale = max(sums[28], 1e-9)
        if up is not None:
            # A rotation w moves the measured up direction by w x measured_up. The rotation should align this
            # direction with +Y.
            measured_up = pose[:3, :3] @ up
            j = -cross_matrix(measured_up)
            weight = scale * _GRAVITY_WEIGHT_M2
            matrix[3:, 3:] += weight * j.T @ j
            gradient[3:] += weight * j.T @ (measured_up - np.array([0.0, 1.0, 0.0]))
        matrix[np.diag_indices(6)] += scale * _DAMPING
        if noise_free is None:
            return np.asarray(-np.linalg.solve(matrix, gradient), np.float64)
        # Whiten: use the coordinates in which the normal matrix is the identity.
        whitening = np.linalg.inv(np.linalg.cholesky(matrix))
        signal_fraction, directions = np.linalg.eigh(whitening @ noise_free @ whitening.T)
        directions = directions.T @ whitening
        return np.asarray(
            -directions.T @ ((directions @ gradient) / signal_fraction.clip(_MIN_SIGNAL_FRACTION, 1.0)),
            np.float64,
        )


def _normal_matrix(sums: Float) -> Float:
    """Returns the (6, 6) normal matrix from the sums of its upper half."""
    matrix = np.zeros((6, 6))
    matrix[_UPPER_INDICES] = sums[:21]
    return np.asarray(matrix + matrix.T - np.diag(np.diag(matrix)))


def denoise_matrix(sums: Float) -> Float:
    """Returns the (6, 6) normal matrix minus the part that the noise of the slopes alone adds to it.

    Slopes are measured, and a sum of their products is too large by the sum of their variances (errors in
    variables: Fuller, Measurement Error Models, 1987, section 1.2). Without the correction, a blank wall
    would seem to constrain the camera along the wall. A slope's noise is perpendicular to it. The variance is
    estimated from the angles between the surface's slopes and the image's normals. These angles contain the
    noise of both, so the correction is slightly too large.
    """
    x, y, z, xx, xy, xz, yy, yz, zz = sums[MOMENT_COUNT : MOMENT_COUNT + 9]
    weight, matrix = sums[28], _normal_matrix(sums)
    mean_cross, products = (
        cross_matrix(np.array([x, y, z])),
        np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]),
    )
    # Build the matrix for slopes in all directions. It is the sum of A A' with A = [1; q x].
    isotropic = np.block(
        [[weight * np.eye(3), mean_cross.T], [mean_cross, np.trace(products) * np.eye(3) - products]]
    )
    return np.asarray(matrix - _slope_variance(sums[MOMENT_COUNT + 9 : SQUARE_COUNT]) * (isotropic - matrix))


def denoise_close_matrix(sums: Float, independent: float) -> Float:
    """Returns the (6, 6) matrix of products of slopes and normals, minus the noise that remains in its sums.
    ``independent`` is the fraction of the points that have independent noise.
    """
    matrix, noise_free = _normal_matrix(sums), _normal_matrix(sums[SQUARE_COUNT + 1 :])
    count = sums[28] ** 2 / max(sums[SQUARE_COUNT], 1e-12)
    return np.asarray(noise_free - (matrix - noise_free) / np.sqrt(max(independent * count, 1.0)))


def _slope_variance(weights: Float) -> float:
    """Returns the variance (rad^2, per axis) of slopes relative to normals, from (BINS,) weights of their
    angles.

    Angles of isotropic noise follow a Rayleigh distribution, with a median of sqrt(2 ln 2) standard
    deviations. The median is robust, because edges and corners, where slope and normal differ, are far fewer
    than half.
    """
    total = np.concatenate([[0.0], np.cumsum(weights)])
    if total[-1] <= 0.0:
        return 0.0
    edges = (MAX_CHORD * np.square(np.arange(BIN_COUNT + 1) / BIN_COUNT)) ** 2
    return float(np.interp(0.5 * total[-1], total, edges) / (2.0 * np.log(2.0)))
