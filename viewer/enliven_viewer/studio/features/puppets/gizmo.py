"""The gizmo of a control point: three arrows, three planes and a ring, of constant size on the screen.

Red, green and blue are the world's x, y and z. Dragging an arrow moves the point along its axis, a square in
the plane of two axes, and the ring parallel to the image.

This module is used instead of ImGuizmo, because the sizes of ImGuizmo's targets and its colours cannot be set
from Python. Its arrows are 24 pixels wide and its centre is 20 pixels wide, and a finger needs 44 pixels. The
measurements are in ``docs/lab/gizmo.md``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Float32
from enliven_viewer.render.materials.paint import linear_from_srgb
from enliven_viewer.render.overlay.tubes import make_tube_rows
from enliven_viewer.studio.viewport.overlay import Disc, Fill, Line, Point
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.theme import AXIS_COLOURS, HELD_AXIS, MARK, Colour, Paint

ARROW_LENGTH_PX = 84.0
"""Length of an arrow in pixels."""
_SQUARE_START_PX = 24.0
"""Distance in pixels along both axes at which a square begins, so that it does not cover the ring."""
_SQUARE_END_PX = 42.0
"""Distance in pixels along both axes at which a square ends: half of an arrow."""
_GRAB_DISTANCE_PX = 12.0
"""Distance in pixels within which a mouse or a pen can grab an arrow. It is the distance of ImGuizmo."""
FINGER_GRAB_DISTANCE_PX = 22.0
"""Distance in pixels from the middle of a part within which a finger can grab it. So the target is 44 pixels
wide, a common guideline, because a fingertip covers about 9 mm.
"""
_RING_RADIUS_PX = 13.0
"""Radius of the ring in pixels."""
_ARROW_START_PX = 16.0
"""Distance in pixels from the gizmo's position at which an arrow begins, outside of the ring."""
_MIN_FORESHORTENING = 0.2
"""Parts with a smaller foreshortening factor are hidden. A square seen edge-on, or an arrow seen end-on,
cannot be grabbed.
"""
_CONE_FRACTION = 0.24
"""Length of an arrow's cone as a fraction of the arrow's length."""
_GUIDE_HALF_LENGTH_PX = 260.0
"""Half length in pixels of the guide line along which an arrow is dragged: three times the arrow."""
GIZMO_PARTS = ("x", "y", "z", "yz", "zx", "xy", "view")
_SNAP_STEP_FACTORS = np.array([1.0, 2.0, 5.0, 10.0])


@dataclass(frozen=True, eq=False)
class Gizmo:
    """A gizmo at a position (3,) in metres of the world, as seen by a lens."""

    place: Float
    lens: Lens

    @property
    def pixel(self) -> float:
        """Returns the size of a pixel in metres at the gizmo's position."""
        lens = self.lens
        depth = max(float((self.place - lens.view.eye) @ lens.forward), 0.05)
        return 2 * depth / (float(lens.view.clip_from_camera[1, 1]) * lens.size[1])

    def find_part(self, pixel: Point) -> str:
        """Returns the name of the part under a pixel, or an empty string."""
        centre, tips = self._project_arrows()
        if not np.isfinite(centre).all() or not np.isfinite(tips).all():
            return ""
        point = np.array(pixel)
        if np.linalg.norm(point - centre) <= _RING_RADIUS_PX:
            return "view"
        distance, part = min(self._measure_arrow_distances(centre, tips, point), default=(np.inf, ""))
        if distance <= _GRAB_DISTANCE_PX:
            return part
        for axis in range(3):
            if self._is_square_visible(axis) and _is_inside(self._find_square(axis), point):
                return GIZMO_PARTS[3 + axis]
        return ""

    def find_nearest_part(self, pixel: Point) -> str:
        """Returns the name of the part that a finger at a pixel can grab, or an empty string. The part with
        the nearest middle is chosen.
        """
        centre, tips = self._project_arrows()
        if not np.isfinite(centre).all() or not np.isfinite(tips).all():
            return ""
        point = np.array(pixel)
        distances = [(float(np.linalg.norm(point - centre)), "view")]
        distances += self._measure_arrow_distances(centre, tips, point)
        for axis in range(3):
            if self._is_square_visible(axis):
                middle = self._find_square(axis).mean(0)
                distances.append((float(np.linalg.norm(point - middle)), GIZMO_PARTS[3 + axis]))
        distance, part = min(distances)
        return part if distance <= FINGER_GRAB_DISTANCE_PX else ""

    def drag_offset(self, part: str, start: Point, now: Point, *, snap: bool) -> Float | None:
        """Returns the movement (3,) in metres of the world for a drag of a part between two pixels. Returns
        None if a pixel is beyond the horizon of the part's plane.
        """
        if part == "view":
            offset = self.lens.intersect_plane(now, self.place) - self.lens.intersect_plane(start, self.place)
        elif len(part) == 1:
            axis = GIZMO_PARTS.index(part)
            offset = np.eye(3)[axis] * (self._project_on_axis(axis, now) - self._project_on_axis(axis, start))
        else:
            normal = np.eye(3)[GIZMO_PARTS.index(part) - 3]
            first, last = self._intersect_plane(normal, start), self._intersect_plane(normal, now)
            if first is None or last is None:
                return None
            offset = last - first
        step = self.step
        return np.asarray(np.round(offset / step) * step if snap else offset)

    @property
    def step(self) -> float:
        """Returns the step in metres to which Shift snaps the movement: a round number near the size of ten
        pixels.
        """
        wanted_length = 10.0 * self.pixel
        power = 10.0 ** np.floor(np.log10(wanted_length))
        return float(power * _SNAP_STEP_FACTORS[np.abs(_SNAP_STEP_FACTORS * power - wanted_length).argmin()])

    def rows(self, highlighted_part: str, alone: str = "") -> Float32:
        """Returns the arrows as rows of :func:`make_tube_rows`. ``alone`` names the dragged part."""
        arrows = []
        for axis in range(3):
            part = GIZMO_PARTS[axis]
            if self._find_foreshortening(axis) <= _MIN_FORESHORTENING or (alone and part not in alone):
                continue
            arrows.append(
                self._make_arrow(axis, HELD_AXIS if highlighted_part == part else AXIS_COLOURS[axis])
            )
        return np.concatenate(arrows) if arrows else np.zeros((0, 12), np.float32)

    def marks(self, highlighted_part: str, alone: str = "") -> tuple[Fill | Line | Disc, ...]:
        """Returns the squares and the ring, as marks over the image."""
        centre, _ = self._project_arrows()
        if not np.isfinite(centre).all():
            return ()
        marks: list[Fill | Line | Disc] = []
        if len(alone) == 1:
            marks += self._make_guide_line(GIZMO_PARTS.index(alone))
        for axis in range(3):
            part = GIZMO_PARTS[3 + axis]
            if not self._is_square_visible(axis) or (alone and alone != part):
                continue
            colour = _convert_to_float_colour(HELD_AXIS if highlighted_part == part else AXIS_COLOURS[axis])
            corners = tuple((float(x), float(y)) for x, y in self._find_square(axis))
            marks.append(Fill(corners, (*colour[:3], 0.62 if highlighted_part == part else 0.34)))
            marks.append(Line(corners, (*colour[:3], 0.95), 1.5, closed=True))
        if not alone or alone == "view":
            tint = _convert_to_float_colour(HELD_AXIS) if highlighted_part == "view" else (*MARK[:3], 0.85)
            marks.append(Disc((float(centre[0]), float(centre[1])), _RING_RADIUS_PX, tint, 2.0))
        return tuple(marks)

    def _make_guide_line(self, axis: int) -> list[Line]:
        """Returns the guide line along which an arrow is dragged."""
        ends = (
            self.place
            + np.outer([-_GUIDE_HALF_LENGTH_PX, _GUIDE_HALF_LENGTH_PX], np.eye(3)[axis]) * self.pixel
        )
        pixels = self.lens.project(ends)[0]
        if not np.isfinite(pixels).all():
            return []
        first, last = ((float(x), float(y)) for x, y in pixels)
        return [Line((first, last), (*_convert_to_float_colour(AXIS_COLOURS[axis])[:3], 0.55), 1.2)]

    def _make_arrow(self, axis: int, colour: Paint) -> Float32:
        arrow_vector, pixel = np.eye(3)[axis] * self.pixel, self.pixel
        ends = (
            np.outer([_ARROW_START_PX, ARROW_LENGTH_PX * (1 - _CONE_FRACTION), ARROW_LENGTH_PX], arrow_vector)
            + self.place
        )
        tints = linear_from_srgb(np.array([colour, colour], float))
        rows = make_tube_rows(ends[:2], ends[1:], np.array([1.7, 5.6]) * pixel, tints)
        rows[1, 7] = 0.15 * pixel
        return rows

    def _project_arrows(self) -> tuple[Float, Float]:
        """Returns the pixel (2,) of the gizmo's position, and the pixels (3, 2) of the arrow tips."""
        points = np.concatenate([self.place[None], self.place + np.eye(3) * ARROW_LENGTH_PX * self.pixel])
        pixels, _ = self.lens.project(points)
        return pixels[0], pixels[1:]

    def _find_foreshortening(self, axis: int) -> float:
        """Returns the foreshortening of an arrow: 0 along the line of sight, 1 perpendicular to it."""
        sight = (self.place - self.lens.view.eye) / np.linalg.norm(self.place - self.lens.view.eye)
        return float(np.sqrt(max(1.0 - sight[axis] ** 2, 0.0)))

    def _is_square_visible(self, axis: int) -> bool:
        sight = (self.place - self.lens.view.eye) / np.linalg.norm(self.place - self.lens.view.eye)
        return abs(float(sight[axis])) > _MIN_FORESHORTENING

    def _find_square(self, axis: int) -> Float:
        """Returns (4, 2) pixels of the square perpendicular to an axis."""
        first, second = (np.eye(3)[(axis + k) % 3] * self.pixel for k in (1, 2))
        ends = [
            (_SQUARE_START_PX, _SQUARE_START_PX),
            (_SQUARE_END_PX, _SQUARE_START_PX),
            (_SQUARE_END_PX, _SQUARE_END_PX),
            (_SQUARE_START_PX, _SQUARE_END_PX),
        ]
        corners = np.array([self.place + a * first + b * second for a, b in ends])
        return self.lens.project(corners)[0]

    def _measure_arrow_distances(self, centre: Float, tips: Float, point: Float) -> list[tuple[float, str]]:
        """Returns the distance in pixels from each visible arrow, with the arrow's name."""
        return [
            (self._measure_arrow_distance(centre, tips[axis], point), GIZMO_PARTS[axis])
            for axis in range(3)
            if self._find_foreshortening(axis) > _MIN_FORESHORTENING
        ]

    @staticmethod
    def _measure_arrow_distance(centre: Float, tip: Float, point: Float) -> float:
        """Returns the distance in pixels from the outer part of an arrow."""
        arrow_vector = tip - centre
        length = float(arrow_vector @ arrow_vector)
        if length < 1e-9:
            return np.inf
        start = _ARROW_START_PX / ARROW_LENGTH_PX
        fraction = float(np.clip((point - centre) @ arrow_vector / length, start, 1.05))
        return float(np.linalg.norm(centre + fraction * arrow_vector - point))

    def _project_on_axis(self, axis: int, pixel: Point) -> float:
        """Returns the distance in metres along an axis from the gizmo's position to the point nearest to a
        pixel's ray.
        """
        ray, line = self.lens.ray(pixel), np.eye(3)[axis]
        between, slant = self.place - self.lens.view.eye, float(ray @ line)
        return float((slant * (ray @ between) - line @ between) / max(1.0 - slant * slant, 1e-6))

    def _intersect_plane(self, normal: Float, pixel: Point) -> Float | None:
        """Returns the intersection (3,) of a pixel's ray with the plane through the gizmo's position. Returns
        None if they do not intersect.
        """
        ray, eye = self.lens.ray(pixel), self.lens.view.eye
        steep, away = float(ray @ normal), float((self.place - eye) @ normal)
        if abs(steep) < 1e-3 or away / steep <= 0.0:
            return None
        return np.asarray(eye + ray * (away / steep))


def _is_inside(corners: Float, point: Float) -> bool:
    """Returns True if a pixel is inside a convex quadrilateral (4, 2)."""
    side_vectors, arm = np.roll(corners, -1, 0) - corners, point - corners
    side = side_vectors[:, 0] * arm[:, 1] - side_vectors[:, 1] * arm[:, 0]
    return bool(np.isfinite(side).all() and ((side >= 0).all() or (side <= 0).all()))


def _convert_to_float_colour(colour: Paint) -> Colour:
    return (colour[0] / 255, colour[1] / 255, colour[2] / 255, 1.0)
