"""Selects image pairs for a stereo calibration, rates its quality, and gives advice if it is poor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, UInt8
from enliven_edge.sensors.stereo.board import CalibrationBoard
from enliven_edge.sensors.stereo.calibration import StereoCalibration
from enliven_edge.sensors.stereo.stereo_solver import MIN_PAIRS, BoardSighting, StereoSolution

_MAX_STILL_MOTION = 0.01
"""Maximum motion of the corners since the previous pair for which the board counts as still, as a fraction of
the image's width."""
_MIN_NEW_MOTION = 0.06
"""Minimum distance between the corners of a new pair and of each kept pair, as a fraction of the image's
width.
"""
_MIN_SHARED_CORNERS = 8
"""Minimum number of shared corners to compare two sightings."""


class PairSelector:
    """Keeps image pairs in which both cameras see the board, held still at a new position or angle.

    Attributes:
        kept: the sightings.
    """

    def __init__(self, board: CalibrationBoard) -> None:
        self._board = board
        self._before: BoardSighting | None = None
        self.kept: list[BoardSighting] = []

    def offer(self, left: UInt8, right: UInt8) -> str:
        """Tries a pair. Returns an empty string if it was kept, else advice."""
        seen = BoardSighting(str(len(self.kept) + 1), self._board.find(left), self._board.find(right))
        previous, self._before = self._before, seen
        for side in ("left", "right"):
            if len(getattr(seen, side)) < _MIN_SHARED_CORNERS:
                return f"the {side} camera does not see enough of the board"
        width = left.shape[1]
        if previous is None or _corner_motion(previous, seen) > _MAX_STILL_MOTION * width:
            return "hold the board still"
        if any(_corner_motion(kept_sighting, seen) < _MIN_NEW_MOTION * width for kept_sighting in self.kept):
            return "move or tilt the board"
        self.kept.append(seen)
        return ""


def _corner_motion(first: BoardSighting, second: BoardSighting) -> float:
    """Returns the mean distance in pixels between shared corners, in the camera in which it is larger.

    The result is infinite if too few are shared.
    """
    motions = []
    for side in ("left", "right"):
        a, b = getattr(first, side), getattr(second, side)
        shared = a.keys() & b.keys()
        if len(shared) < _MIN_SHARED_CORNERS:
            return float("inf")
        motions.append(float(np.mean([np.linalg.norm(a[n] - b[n]) for n in shared])))
    return max(motions)


_GOOD_REPROJECTION_PX = 0.35
"""Maximum reprojection error in pixels that still counts as good. In a sharp image corners are accurate to
0.1 to 0.3 pixels."""
_MAX_REPROJECTION_PX = 1.0
"""Maximum reprojection error in pixels. With a larger error, the lens model does not fit."""
_GOOD_EPIPOLAR_PX = 0.3
"""Maximum distance in pixels between matching rows that still counts as good. The matcher searches only along
one row."""
_MAX_EPIPOLAR_PX = 0.6
"""Maximum distance in pixels between matching rows. The matcher loses fine texture at half a pixel."""
_REPORT_DISTANCE_M = 2.0
"""Distance in metres for which the expected error is reported."""
_GOOD_ERROR = 0.01
"""Expected relative depth error that still counts as good: 20 mm at 2 m, similar to that of a depth
camera."""
_MAX_ERROR = 0.03
"""Maximum expected relative depth error. With a larger one, limbs are hardly thicker than the error."""
_MATCHER_ERROR_PX = 0.12
"""Median disparity error of the matcher on rendered people, in pixels (benchmark sensors.stereo_error_mm)."""
_MIN_COVERED = 0.6
"""Minimum fraction of the image's grid fields that contain corners. In the other fields the lens distortion
is only extrapolated."""
_MIN_TILT_DEG = 20.0
"""Minimum angle in degrees between two boards. Parallel boards do not separate focal length from distance."""
_ROWS, _COLUMNS = ("upper", "middle", "lower"), ("left", "centre left", "centre right", "right")
"""Names of the grid fields of an image."""


@dataclass(frozen=True)
class CalibrationQuality:
    """The rating of a calibration.

    Attributes:
        verdict: "good", "fair" or "not good enough".
        facts: lines of name and value.
        advice: one sentence per remedy; empty if the calibration is good.
    """

    verdict: str
    facts: list[tuple[str, str]]
    advice: list[str]

    @property
    def is_usable(self) -> bool:
        """Returns True if the calibration may be used without the user's confirmation."""
        return self.verdict != "not good enough"


def rate_solution(board: CalibrationBoard, solution: StereoSolution) -> CalibrationQuality:
    """Returns the rating of a solution."""
    facts = [("pairs", f"{len(solution.used)} used, {len(solution.left_out)} left out")]
    facts += [("left out", f"{name}: {reason}") for name, reason in solution.left_out.items()]
    calibration = solution.calibration
    if calibration is None:
        lacking = (
            f"Capture at least {MIN_PAIRS} pairs that show most of the board in both images. Hold the "
            "board still."
        )
        return CalibrationQuality("not good enough", facts, [lacking])
    error = compute_expected_depth_error(calibration, solution.disparity_error, _REPORT_DISTANCE_M)
    covered = {side: _find_covered_fields(calibration, solution, side) for side in ("left", "right")}
    facts += [
        ("baseline", f"{1e3 * calibration.baseline:.1f} mm"),
        (
            "lenses",
            ", ".join(
                f"{side} {_field_of_view(calibration, side):.0f} degrees wide" for side in ("left", "right")
            ),
        ),
        ("corners", f"error {calibration.reprojection:.2f} px (good below {_GOOD_REPROJECTION_PX})"),
        ("rows", f"{calibration.epipolar:.2f} px apart when rectified (good below {_GOOD_EPIPOLAR_PX})"),
        (
            "depth at 2 m",
            f"expected error {1e3 * error:.0f} mm (good below {1e3 * _GOOD_ERROR * _REPORT_DISTANCE_M:.0f})",
        ),
        (
            "seen",
            ", ".join(f"{side} {100 * seen.mean():.0f} % of the image" for side, seen in covered.items()),
        ),
    ]
    advice, bad = _create_advice(calibration, solution, error, covered)
    return CalibrationQuality("not good enough" if bad else "fair" if advice else "good", facts, advice)


def compute_expected_depth_error(
    calibration: StereoCalibration, disparity_error: float, distance: float
) -> float:
    """Returns the expected depth error in metres at a distance in metres."""
    disparity = float(np.hypot(disparity_error, _MATCHER_ERROR_PX))
    return distance**2 * disparity / (calibration.left.fx * calibration.baseline)


def _create_advice(
    calibration: StereoCalibration, solution: StereoSolution, error: float, covered: dict[str, Float]
) -> tuple[list[str], bool]:
    """Returns the advice, and whether the calibration is unusable without following it."""
    advice, bad = [], False
    if calibration.translation[0] > 0:
        advice.append("The left and the right camera, seen from behind, are swapped: exchange their numbers.")
        bad = True
    if calibration.reprojection > _GOOD_REPROJECTION_PX:
        advice.append(
            "The corners are inaccurate: glue the board to glass or a flat panel, hold it still, light it "
            "well."
        )
        bad |= calibration.reprojection > _MAX_REPROJECTION_PX
    if calibration.epipolar > _GOOD_EPIPOLAR_PX:
        advice.append(
            "The image rows do not match: screw both cameras to one stiff bar, and capture both at one "
            "moment."
        )
        bad |= calibration.epipolar > _MAX_EPIPOLAR_PX
    if error > _GOOD_ERROR * _REPORT_DISTANCE_M:
        advice.append(
            "Depth will be inaccurate: also capture pairs farther away, or use a longer bar or larger images."
        )
        bad |= error > _MAX_ERROR * _REPORT_DISTANCE_M
    if solution.tilt < _MIN_TILT_DEG:
        advice.append("Tilt the board by 30 degrees: to each side in some pairs, up and down in others.")
        bad = True
    for side, seen in covered.items():
        if seen.mean() < _MIN_COVERED:
            empty = ", ".join(f"{_ROWS[i]} {_COLUMNS[j]}" for i, j in np.argwhere(seen == 0)[:4])
            advice.append(
                f"The {side} camera has not seen the board at the {empty}: hold the board there, too."
            )
            bad = True
    return advice, bad


def _find_covered_fields(calibration: StereoCalibration, solution: StereoSolution, side: str) -> Float:
    """Returns (3, 4) flags: 1 for each field of an image with corners in it, 0 for the others."""
    rows, columns = len(_ROWS), len(_COLUMNS)
    covered_fields = np.zeros((rows, columns))
    for sighting in solution.used:
        for x, y in getattr(sighting, side).values():
            row, column = int(y * rows / calibration.height), int(x * columns / calibration.width)
            covered_fields[min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)] = 1
    return covered_fields


def _field_of_view(calibration: StereoCalibration, side: str) -> float:
    """Returns the horizontal field of view of a camera in degrees, from its focal length."""
    return float(2 * np.degrees(np.arctan(0.5 * calibration.width / getattr(calibration, side).fx)))
