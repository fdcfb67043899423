"""The printed board for camera calibration (ChArUco): a chessboard with numbered markers in its squares."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from enliven.arrays import Float, UInt8
from enliven.errors import InputError
from enliven_edge.sensors.stereo.rectification import import_opencv

_MARKER_RATIO = 0.75
"""Side of a marker relative to the side of its square. OpenCV needs a white margin around the marker."""
_MARKER_CELLS = 6
"""Number of cells along a marker's side in the dictionary 4x4, including the marker's black border."""
_MARKER_COUNT = 50
"""Number of markers in the dictionary 4x4."""
_UNITS_PER_MM = 72 / 25.4
"""PDF units per millimetre."""
_PAPERS = {"A4": (297.0, 210.0), "A3": (420.0, 297.0), "A2": (594.0, 420.0)}
"""Sizes of paper sheets in landscape orientation in millimetres, the smallest first."""
_PRINT_MARGIN_MM = 8.0
"""Margin in millimetres that a printer may leave white."""


@dataclass(frozen=True)
class CalibrationBoard:
    """A ChArUco board of ``columns`` x ``rows`` squares.

    Attributes:
        square: side of a square in metres.
    """

    columns: int = 7
    rows: int = 5
    square: float = 0.038

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 3 or self.columns * self.rows > 2 * _MARKER_COUNT:
            raise InputError(
                f"a board of {self.columns} x {self.rows} squares is impossible",
                where="board",
                remedy=f"Use at least 3 x 3 squares, and at most {2 * _MARKER_COUNT} squares in total.",
            )
        if not 0.005 <= self.square <= 1.0:
            raise InputError(
                f"the squares are {1e3 * self.square:g} mm wide",
                where="board",
                remedy="Use squares of 5 to 1000 mm.",
            )

    def find(self, image: UInt8) -> dict[int, Float]:
        """Returns the visible inner corners in a grey image (H, W): pixels by corner number.

        The result is empty if there are none.
        """
        corners, numbers, *_ = self._detector.detectBoard(image)
        if numbers is None or corners is None:
            return {}
        numbered_points = zip(np.ravel(numbers), np.reshape(corners, (-1, 2)), strict=True)
        return {int(number): np.asarray(point, np.float64) for number, point in numbered_points}

    @cached_property
    def points(self) -> Float:
        """Returns (N, 3) the inner corners in metres in the board's frame, by corner number."""
        return np.reshape(self.drawing.getChessboardCorners(), (-1, 3)).astype(np.float64)

    @cached_property
    def drawing(self) -> Any:
        """Returns OpenCV's board."""
        cv = import_opencv()
        markers = cv.aruco.getPredefinedDictionary(cv.aruco.DICT_4X4_50)
        size = (self.columns, self.rows)
        return cv.aruco.CharucoBoard(size, self.square, _MARKER_RATIO * self.square, markers)

    @cached_property
    def _detector(self) -> Any:
        cv = import_opencv()
        settings = cv.aruco.DetectorParameters()
        settings.cornerRefinementMethod = cv.aruco.CORNER_REFINE_SUBPIX
        return cv.aruco.CharucoDetector(self.drawing, cv.aruco.CharucoParameters(), settings)

    def rectangles(self) -> Float:
        """Returns (N, 4) left, top, width and height of all black rectangles.

        They are in metres from the board's upper left corner.
        """
        cv, side = import_opencv(), self.square
        black = [
            (column * side, row * side, side, side)
            for row in range(self.rows)
            for column in range(self.columns)
            if (row + column) % 2 == 0
        ]
        cell = _MARKER_RATIO * side / _MARKER_CELLS
        for number, corners in zip(self.drawing.getIds().ravel(), self.drawing.getObjPoints(), strict=True):
            picture = cv.aruco.generateImageMarker(self.drawing.getDictionary(), int(number), _MARKER_CELLS)
            x, y, _ = np.reshape(corners, (-1, 3)).min(0)
            black += [(x + j * cell, y + i * cell, cell, cell) for i, j in np.argwhere(picture == 0)]
        return np.array(black, np.float64)

    def pdf(self) -> bytes:
        """Returns a PDF of a sheet with the board in its exact size, and with its dimensions as text.

        Raises:
            InputError: if no paper format is large enough.
        """
        wide, high = 1e3 * self.square * self.columns, 1e3 * self.square * self.rows
        fitting = [
            name
            for name, (w, h) in _PAPERS.items()
            if wide + 2 * _PRINT_MARGIN_MM <= w and high + 2 * _PRINT_MARGIN_MM <= h
        ]
        if not fitting:
            problem = f"a board of {wide:.0f} x {high:.0f} mm fits on no sheet up to A2"
            raise InputError(problem, where="board", remedy="Use smaller squares, such as --square 38")
        paper = fitting[0]
        across, down = _PAPERS[paper]
        left, top = (across - wide) / 2, (down - high) / 2
        lines = [
            f"{_UNITS_PER_MM * (left + 1e3 * x):.4f} {_UNITS_PER_MM * (down - top - 1e3 * (y + h)):.4f} "
            f"{_UNITS_PER_MM * 1e3 * w:.4f} {_UNITS_PER_MM * 1e3 * h:.4f} re"
            for x, y, w, h in self.rectangles()
        ]
        words = f"{paper}: {self.columns} x {self.rows} squares of {1e3 * self.square:g} mm; print at 100 %"
        text = f"BT /F 8 Tf {_UNITS_PER_MM * left:.2f} {_UNITS_PER_MM * (top / 3):.2f} Td ({words}) Tj ET"
        return _pdf("\n".join([*lines, "f", text]), _UNITS_PER_MM * across, _UNITS_PER_MM * down)


def _pdf(drawing: str, width: float, height: float) -> bytes:
    stream = drawing.encode("ascii")
    font = "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>"
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.4f} {height:.4f}] /Contents 4 0 R "
        f"/Resources << /Font << /F {font} >> >> >>".encode(),
        b"<< /Length %d >>\nstream\n%s\nendstream" % (len(stream), stream),
    ]
    document, places = b"%PDF-1.4\n", []
    for number, content in enumerate(objects, 1):
        places.append(len(document))
        document += b"%d 0 obj\n%s\nendobj\n" % (number, content)
    table = "".join(f"{place:010} 00000 n \n" for place in places)
    head = f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n{table}"
    tail = f"trailer << /Size {len(objects) + 1} /Root 1 0 R >>\nstartxref\n{len(document)}\n%%EOF\n"
    return document + head.encode() + tail.encode()
