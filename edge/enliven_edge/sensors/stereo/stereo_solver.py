"""Calibrates two cameras from sightings of a board: intrinsics and relative pose."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from enliven.arrays import Float
from enliven_edge.sensors.stereo.board import CalibrationBoard
from enliven_edge.sensors.stereo.calibration import StereoCalibration, StereoLens
from enliven_edge.sensors.stereo.rectification import Rectification, import_opencv

_MIN_CORNERS = 8
"""Minimum number of a board's corners that both cameras must see. Six determine its pose, the others reveal
errors."""
MIN_PAIRS = 8
"""Minimum number of image pairs. Two lenses and a pose have 24 unknowns, and each pair adds another board
pose."""
_OUTLIER_RATIO = 3.0
"""A pair is dropped as an outlier if its error exceeds the median error by this factor. Its board was moving,
or was bent."""
_INLIER_ERROR_PX = 0.3
"""Error in pixels below which no pair is dropped."""


@dataclass(frozen=True)
class BoardSighting:
    """One pair of images, and the pixels of the board's corners in each, by corner number."""

    name: str
    left: dict[int, Float]
    right: dict[int, Float]

    def find_common_corners(self, board: CalibrationBoard) -> tuple[Float, Float, Float]:
        """Returns the corners that both cameras see: (N, 3) on the board, (N, 2) and (N, 2) in the images."""
        numbers = sorted(self.left.keys() & self.right.keys())
        left, right = ([side[n] for n in numbers] for side in (self.left, self.right))
        return board.points[numbers], np.reshape(left, (-1, 2)), np.reshape(right, (-1, 2))


@dataclass(frozen=True)
class StereoSolution:
    """The calibration from a set of sightings.

    Attributes:
        calibration: the calibration; None if there were too few sightings.
        used: the sightings that were used.
        left_out: reasons for dropping pairs, by the name of the pair.
        disparity_error: root mean square difference in pixels between measured and expected disparities of
            the boards. It is cross-validated: each half of the pairs is tested with a calibration from the
            other half.
        tilt: the largest angle in degrees between the normals of two boards.
    """

    calibration: StereoCalibration | None
    used: list[BoardSighting]
    left_out: dict[str, str] = field(default_factory=dict)
    disparity_error: float = 0.0
    tilt: float = 0.0


def solve(board: CalibrationBoard, sightings: list[BoardSighting], size: tuple[int, int]) -> StereoSolution:
    """Returns the calibration that fits the sightings best. Pairs that do not fit are dropped.

    Args:
        size: (width, height) of the images.
    """
    left_out: dict[str, str] = {}
    used = []
    for sighting in sightings:
        reason = _explain_unusable(sighting)
        if reason:
            left_out[sighting.name] = reason
        else:
            used.append(sighting)
    while len(used) >= MIN_PAIRS:
        calibration, errors = _fit(board, used, size)
        worst = int(np.argmax(errors))
        if errors[worst] <= max(_OUTLIER_RATIO * float(np.median(errors)), _INLIER_ERROR_PX):
            tilt = _widest_tilt(board, used, calibration)
            return StereoSolution(calibration, used, left_out, _cross_validate(board, used, size), tilt)
        left_out[used[worst].name] = (
            f"the corners are {errors[worst]:.1f} px off, because the board was moved, blurred or bent"
        )
        used = [sighting for sighting in used if sighting is not used[worst]]
    return StereoSolution(None, used, left_out)


def disparity_offset(
    board: CalibrationBoard,
    sighting: BoardSighting,
    rectification: Rectification,
    calibration: StereoCalibration,
) -> float:
    """Returns the mean difference in pixels between a board's disparities and the expected ones.

    The expected disparity follows from the board's distance, which is measured in the left image by the
    board's size.
    """
    cv, lens = import_opencv(), calibration.left
    points, left, right = sighting.find_common_corners(board)
    columns = [pixel_points[:, 0] for pixel_points in rectify_points(rectification, calibration, left, right)]
    _, turn, shift = cv.solvePnP(points, left, lens.matrix(), np.array(lens.distortion))
    depth = ((points @ cv.Rodrigues(turn)[0].T + shift.T) @ rectification.rotations[0].T)[:, 2]
    expected = rectification.intrinsics.fx * rectification.baseline / depth
    return float(np.mean(columns[0] - columns[1] - expected))


def _explain_unusable(sighting: BoardSighting) -> str:
    """Returns why a stereo pair cannot be used, or an empty string if it can be used."""
    for side in ("left", "right"):
        if not getattr(sighting, side):
            return f"the {side} camera does not see the board"
    common = len(sighting.left.keys() & sighting.right.keys())
    return "" if common >= _MIN_CORNERS else f"only {common} corners are visible to both cameras"


def _fit(
    board: CalibrationBoard, used: list[BoardSighting], size: tuple[int, int]
) -> tuple[StereoCalibration, Float]:
    """Returns the calibration from all these sightings, and the error in pixels of each, (N,)."""
    cv = import_opencv()
    lenses = []
    for side in ("left", "right"):
        side_corners = [getattr(sighting, side) for sighting in used]
        points = [board.points[sorted(corners)].astype(np.float32) for corners in side_corners]
        pixels = [np.array([c[n] for n in sorted(c)], np.float32)[:, None] for c in side_corners]
        _, matrix, distortion, *_ = cv.calibrateCamera(points, pixels, size, None, None)
        lenses += [matrix, np.ravel(distortion)[:5]]
    common = [
        [part.astype(np.float32)[:, None] for part in sighting.find_common_corners(board)]
        for sighting in used
    ]
    error, *lenses, turn, shift, _, _, _, _, errors = cv.stereoCalibrateExtended(
        *zip(*common, strict=True),
        *lenses,
        size,
        np.eye(3),
        np.zeros((3, 1)),
        flags=cv.CALIB_USE_INTRINSIC_GUESS,
    )
    calibration = StereoCalibration(
        width=size[0],
        height=size[1],
        left=_lens(lenses[0], lenses[1]),
        right=_lens(lenses[2], lenses[3]),
        right_from_left=tuple(tuple(float(v) for v in row) for row in turn),  # type: ignore[arg-type]
        translation=tuple(float(v) for v in np.ravel(shift)),  # type: ignore[arg-type]
        baseline=float(np.linalg.norm(shift)),
        reprojection=float(error),
        epipolar=0.0,
    )
    rectification = Rectification(calibration)
    rectified = [
        rectify_points(rectification, calibration, *sighting.find_common_corners(board)[1:])
        for sighting in used
    ]
    row_errors = np.concatenate([left[:, 1] - right[:, 1] for left, right in rectified])
    epipolar = float(np.sqrt(np.mean(row_errors**2)))
    return replace(calibration, epipolar=epipolar), np.asarray(errors).reshape(len(used), -1).max(1)


def _lens(matrix: Float, distortion: Float) -> StereoLens:
    k1, k2, p1, p2, k3 = (float(v) for v in np.ravel(distortion)[:5])
    fx, fy, cx, cy = (float(matrix[cell]) for cell in ((0, 0), (1, 1), (0, 2), (1, 2)))
    return StereoLens(fx, fy, cx, cy, (k1, k2, p1, p2, k3))


def rectify_points(
    rectification: Rectification, calibration: StereoCalibration, left: Float, right: Float
) -> tuple[Float, Float]:
    """Converts (N, 2) pixels of both cameras to (N, 2) and (N, 2) pixels of the rectified images."""
    camera = rectification.intrinsics
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    sides = zip((left, right), (calibration.left, calibration.right), rectification.rotations, strict=True)
    undistort = import_opencv().undistortPoints
    flat_left, flat_right = (
        undistort(pixels[:, None], lens.matrix(), np.array(lens.distortion), R=turn, P=matrix)[:, 0]
        for pixels, lens, turn in sides
    )
    return flat_left, flat_right


def _cross_validate(board: CalibrationBoard, used: list[BoardSighting], size: tuple[int, int]) -> float:
    """Returns the cross-validated root mean square disparity error in pixels.

    Each half of the sightings is tested with a calibration from the other half.
    """
    errors = []
    for training in (0, 1):
        calibration, _ = _fit(board, used[training::2], size)
        rectification = Rectification(calibration)
        errors += [
            disparity_offset(board, test, rectification, calibration) for test in used[1 - training :: 2]
        ]
    return float(np.sqrt(np.mean(np.square(errors))))


def _widest_tilt(board: CalibrationBoard, used: list[BoardSighting], calibration: StereoCalibration) -> float:
    """Returns the largest angle in degrees between the normals of two boards."""
    cv = import_opencv()
    lens = calibration.left
    normals = []
    for sighting in used:
        points, left, _ = sighting.find_common_corners(board)
        _, turn, _ = cv.solvePnP(points, left, lens.matrix(), np.array(lens.distortion))
        normals.append(cv.Rodrigues(turn)[0][:, 2])
    smallest = float(np.min(np.array(normals) @ np.array(normals).T))
    return float(np.degrees(np.arccos(np.clip(smallest, -1, 1))))
