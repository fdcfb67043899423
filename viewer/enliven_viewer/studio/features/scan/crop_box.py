"""The crop box around the object, which the artist can change. Dragging the handle at the centre of a side
moves the side.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from enliven.arrays import Float
from enliven_viewer.studio.viewport.overlay import Disc, Line, Point
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.theme import ACCENT

_GRAB_DISTANCE_PX = 16.0
"""Distance in pixels within which a handle can be grabbed."""
_HANDLE_RADIUS_PX = 7.0
"""Radius of a handle in pixels."""
_MIN_SIDE_M = 0.02
"""Minimum length of a box side in metres."""
_CONTENT_MARGIN_M = 0.03
"""Margin of the initial box around its content, in metres."""
_SEARCH_HALF_WIDTH_M = 0.8
"""Half width in metres of the area around the stage's centre in which the object is searched for the initial
box.
"""
_MIN_HEIGHT_M = 0.03
"""Surfaces higher than this in metres do not belong to the floor."""
_INITIAL_BOX = np.array([[-0.4, 0.0, -0.4], [0.4, 1.0, 0.4]])
"""(2, 3) metres: the box used before anything was scanned, the size of a chair."""
_EDGES = [(a, b) for a, b in product(range(8), range(8)) if a < b and (a ^ b) in (1, 2, 4)]
"""The twelve edges as pairs of corners. Bit k of a corner's number is set if it is high along axis k."""
_BOX_OPACITY = 0.7
"""Opacity of the box, so that the object in it stays visible."""


def find_initial_box(points: Float) -> Float:
    """Returns the corners (2, 3) in metres of a box around the points near the centre of the stage.

    Args:
        points: (N, 3) metres on the stage.
    """
    is_near = (np.abs(points[:, [0, 2]]) < _SEARCH_HALF_WIDTH_M).all(1) & (points[:, 1] > _MIN_HEIGHT_M)
    if not is_near.any():
        return _INITIAL_BOX.copy()
    low, high = np.quantile(points[is_near], [0.02, 0.98], axis=0)
    return np.array([[low[0] - _CONTENT_MARGIN_M, 0.0, low[2] - _CONTENT_MARGIN_M], high + _CONTENT_MARGIN_M])


class CropBox:
    """A box on the stage, with its handles.

    Attributes:
        corners: (2, 3) metres, the lowest and the highest corner.
    """

    def __init__(self) -> None:
        self.corners: Float = _INITIAL_BOX.copy()
        self._held_handle: tuple[int, int] | None = None

    def press(self, pixel: Point, lens: Lens) -> bool:
        """Handles a button press. Returns True if a handle was grabbed."""
        near_handles = [
            (away, side)
            for side, away in self._measure_handle_distances(pixel, lens)
            if away <= _GRAB_DISTANCE_PX
        ]
        self._held_handle = min(near_handles)[1] if near_handles else None
        return self._held_handle is not None

    def drag(self, pixel: Point, lens: Lens) -> None:
        """Moves the dragged side to the point on the handle's line that is nearest to the pointer's ray."""
        if self._held_handle is None:
            return
        end, axis = self._held_handle
        through, eye, ray = self.find_handle(end, axis), lens.view.eye, lens.ray(pixel)
        # Compute the point on the line of the handle that is closest to the pointer's ray.
        across = np.cross(np.eye(3)[axis], ray)
        square = float(across @ across)
        if square < 1e-6:
            return
        distance = float(np.cross(eye - through, ray) @ across) / square
        new_coordinate = float(through[axis]) + distance
        other = float(self.corners[1 - end, axis])
        self.corners[end, axis] = (
            min(new_coordinate, other - _MIN_SIDE_M) if end == 0 else max(new_coordinate, other + _MIN_SIDE_M)
        )

    def release(self) -> None:
        """Handles the release of the button."""
        self._held_handle = None

    def move_with_scan(self, before: Float, after: Float) -> None:
        """Moves the box with the scan when the edge changes the scan's pose on the stage. The edge does this
        until it has found the floor.

        Args:
            before, after: (4, 4) transforms from the scan's world to the stage. Both are upright, so vertical
                sides stay vertical. A side on the floor stays on the floor.
        """
        change = after @ np.linalg.inv(before)
        middle = self.corners.mean(0)
        shift = np.broadcast_to(change[:3, :3] @ middle + change[:3, 3] - middle, (2, 3)).copy()
        if abs(self.corners[0, 1]) < _MIN_HEIGHT_M:
            shift[0, 1] = 0.0
        self.corners = self.corners + shift
        self.corners[1, 1] = max(self.corners[1, 1], self.corners[0, 1] + _MIN_SIDE_M)

    def marks(self, lens: Lens) -> tuple[Line | Disc, ...]:
        """Returns the box's edges and handles in the viewport's pixels."""
        corners = np.array([[self.corners[k >> axis & 1, axis] for axis in range(3)] for k in range(8)])
        lines = []
        for a, b in _EDGES:
            ends = tuple(lens.project_visible(corners[[a, b]]))
            if len(ends) == 2:
                lines.append(Line(ends, (*ACCENT[:3], _BOX_OPACITY), 2.0))
        discs = []
        for end, axis in product((0, 1), range(3)):
            for pixel in lens.project_visible(self.find_handle(end, axis)[None]):
                held = self._held_handle == (end, axis)
                discs.append(Disc(pixel, _HANDLE_RADIUS_PX * (1.4 if held else 1.0), ACCENT))
        return (*lines, *discs)

    def find_handle(self, end: int, axis: int) -> Float:
        """Returns the centre (3,) in metres of the low (``end`` 0) or high (``end`` 1) side along an axis."""
        middle = np.asarray(self.corners.mean(0))
        middle[axis] = self.corners[end, axis]
        return middle

    def _measure_handle_distances(self, at: Point, lens: Lens) -> list[tuple[tuple[int, int], float]]:
        """Returns each handle in front of the camera, with its distance in pixels from a point."""
        distances = []
        for side in product((0, 1), range(3)):
            for pixel in lens.project_visible(self.find_handle(*side)[None]):
                distances.append((side, float(np.hypot(pixel[0] - at[0], pixel[1] - at[1]))))
        return distances
