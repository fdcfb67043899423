"""The calibration file of two cameras: a TOML file that can be read and corrected by hand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.files import write_file
from enliven.settings import TOML_VERSION, data_field, load_settings, refuse_later_toml

_BASELINE_TOLERANCE_M = 1e-3
"""Tolerated difference in metres between the baseline and the length of the translation. A mistake in an
edited file is larger."""
_ROTATION_TOLERANCE = 1e-3
"""Tolerance of the entries of R' R - I for a rotation R."""
_Row = tuple[float, float, float]


@dataclass(frozen=True)
class StereoLens:
    """One camera of the pair."""

    fx: float = data_field(doc="Horizontal focal length.", unit="px", low=10, high=20000)
    fy: float = data_field(doc="Vertical focal length.", unit="px", low=10, high=20000)
    cx: float = data_field(
        doc="Horizontal principal point, measured from the centre of the left column.",
        unit="px",
        low=0,
        high=16384,
    )
    cy: float = data_field(
        doc="Vertical principal point, measured from the centre of the top row.", unit="px", low=0, high=16384
    )
    distortion: tuple[float, float, float, float, float] = data_field(
        doc="Brown-Conrady distortion coefficients k1, k2, p1, p2, k3."
    )

    def matrix(self) -> Float:
        """Returns the (3, 3) camera matrix."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class StereoCalibration:
    """The calibration of a camera pair: two sets of intrinsics, and the pose of the right camera relative to
    the left one.
    """

    width: int = data_field(doc="Width of both images.", unit="px", low=32, high=16384)
    height: int = data_field(doc="Height of both images.", unit="px", low=32, high=16384)
    left: StereoLens = data_field(doc="Intrinsics of the left camera, seen from behind the cameras.")
    right: StereoLens = data_field(doc="Intrinsics of the right camera.")
    right_from_left: tuple[_Row, _Row, _Row] = data_field(
        doc="(3, 3) rotation from the left to the right camera frame."
    )
    translation: _Row = data_field(
        doc="Position of the left camera in the right camera's frame; x is minus the baseline.", unit="m"
    )
    baseline: float = data_field(doc="Distance between the two cameras.", unit="m", low=0.005, high=5.0)
    reprojection: float = data_field(
        doc="Root mean square reprojection error of the board's corners.", unit="px", low=0, high=100
    )
    epipolar: float = data_field(
        doc="Root mean square epipolar error: difference in rows after rectification.",
        unit="px",
        low=0,
        high=100,
    )


def load_calibration(path: Path) -> StereoCalibration:
    """Reads a calibration that :func:`save_calibration` wrote.

    Raises:
        InputError: for an unreadable file, a wrong or missing key, or values that contradict each other.
    """
    if not path.exists():
        raise InputError(
            "there is no such file",
            where=str(path),
            remedy="Create the calibration with enliven calibrate-stereo (docs/stereo.md).",
        )
    calibration = load_settings(StereoCalibration, path)
    contradiction = _find_contradiction(calibration)
    if contradiction:
        raise InputError(contradiction, where=str(path), remedy="Calibrate again: enliven calibrate-stereo.")
    return calibration


def save_calibration(path: Path, calibration: StereoCalibration, remarks: list[str]) -> None:
    """Writes the file completely or not at all.

    Raises:
        InputError: if the file is of a later version. It is left unchanged.
        ResourceError: if it cannot be written. The previous file is left unchanged.
    """
    refuse_later_toml(path)
    write_file(path, _format_calibration(calibration, remarks))


def _find_contradiction(calibration: StereoCalibration) -> str:
    """Returns a description of a contradiction in a calibration, or an empty string if there is none."""
    rotation, translation = np.array(calibration.right_from_left), np.array(calibration.translation)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > _ROTATION_TOLERANCE or np.linalg.det(rotation) < 0:
        return "right_from_left is not a rotation"
    if abs(float(np.linalg.norm(translation)) - calibration.baseline) > _BASELINE_TOLERANCE_M:
        length = np.linalg.norm(translation)
        return f"the baseline is {calibration.baseline} m, but the translation is {length:.4f} m long"
    baseline_axis = -float((rotation.T @ translation)[0])
    if baseline_axis > 0 and baseline_axis < calibration.baseline * math.cos(math.radians(45)):
        return "the cameras are not side by side"
    if baseline_axis < 0:
        return "the left and the right camera are swapped"
    for name, lens in (("left", calibration.left), ("right", calibration.right)):
        if not (lens.cx < calibration.width and lens.cy < calibration.height):
            return f"the {name} principal point ({lens.cx}, {lens.cy}) is outside the image"
    return ""


def _format_calibration(calibration: StereoCalibration, remarks: list[str]) -> str:
    """Returns the file's text: remarks as comments, then the values."""
    lines = [f"# {' '.join(remark.split())}" for remark in remarks]
    names = ("width", "height", "baseline", "reprojection", "epipolar")
    lines += [
        "",
        f"version = {TOML_VERSION}",
        *(f"{name} = {getattr(calibration, name)!r}" for name in names),
    ]
    lines += [f"translation = {_format_row(calibration.translation)}", "right_from_left = ["]
    lines += [*(f"  {_format_row(row)}," for row in calibration.right_from_left), "]"]
    for name, lens in (("left", calibration.left), ("right", calibration.right)):
        lines += ["", f"[{name}]", *(f"{key} = {getattr(lens, key)!r}" for key in ("fx", "fy", "cx", "cy"))]
        lines += [f"distortion = {_format_row(lens.distortion)}"]
    return "\n".join(lines) + "\n"


def _format_row(values: tuple[float, ...]) -> str:
    return f"[{', '.join(repr(value) for value in values)}]"
