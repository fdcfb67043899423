"""Computes the camera preview of the performers, and places it in the corner where it covers the characters
least.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.person import BONES, Body
from enliven.wire import CameraMessage

ASSUMED_CAMERA_HEIGHT = 1.1
"""Assumed height of the camera in metres, as on a table. Used if the messages do not contain the camera's
position.
"""
_TAN_HALF_FOV = np.tan(np.radians(29.0))
"""Tangent of half the assumed vertical field of view. Depth cameras have 56 to 60 degrees."""
DEFAULT_ASPECT = 1.2
"""Default aspect ratio of the preview: that of depth cameras, slightly cropped."""
_MIN_CAMERA_DISTANCE = 0.6
"""Minimum working distance of a depth camera in metres. If performers are nearer to the assumed camera, the
camera is moved back.
"""
_ASSUMED_CAMERA_DISTANCE = 2.5
"""Distance in metres from the performers to the moved camera: the usual distance."""
_HEIGHT_FRACTION = 0.3
"""Height of the inset as a fraction of the view's height, so that the character stays the main subject."""
_MIN_HEIGHT = 104.0
"""Minimum height in pixels. Poses are not recognisable in a smaller image."""
_MAX_HEIGHT = 400.0
"""Maximum height in pixels. A larger image shows no more detail."""
_MAX_WIDTH_FRACTION = 0.45
"""Maximum total width of all insets side by side, as a fraction of the view's width."""
_MARGIN = 14.0
"""Distance in pixels from the border of the view."""
_BOTTOM_SPACE = 62.0
"""Space in pixels below the inset, for the live timeline in the Play workspace and for messages in others."""
_MIN_CORNER_GAIN = 0.25
"""The inset moves to another corner only if this reduces the covered area by at least this fraction of the
inset.
"""
_CORNER_SEARCH_FRAMES = 20
"""Number of frames between two searches for a free corner. The search is slow, because it needs the
characters' vertices.
"""

Rectangle = tuple[float, float, float, float]
"""Left, top, width and height in pixels."""


@dataclass(frozen=True, eq=False)
class ProjectedBody:
    """A performer as seen by a camera.

    Attributes:
        id: id of the performer in this window.
        places: (20, 2) joint positions in the image. x runs to the right from 0 to the aspect ratio, y runs
            down from 0 to 1. NaN behind the camera.
        depth: (20,) depth of the joints in front of the camera in metres.
        confidence: (20,) tracking confidence of the joints in [0, 1].
        focal: focal length as a multiple of the image height.
    """

    id: int
    places: Float
    depth: Float
    confidence: Float
    focal: float = float(0.5 / _TAN_HALF_FOV)

    @property
    def bones(self) -> list[tuple[int, int]]:
        """Returns the bones as pairs of joint indices, farthest first."""
        return sorted(BONES, key=lambda bone: -float(self.depth[list(bone)].sum()))

    def pixels(self, metres: float, joint: int) -> float:
        """Returns the projected size of a length at a joint, as a fraction of the image height."""
        return float(metres * self.focal / max(self.depth[joint], _MIN_CAMERA_DISTANCE))


def find_aspect(camera: CameraMessage | None) -> float:
    """Returns the aspect ratio of a camera's view; :data:`DEFAULT_ASPECT` if it sends no image."""
    return DEFAULT_ASPECT if camera is None or not camera.height else camera.width / camera.height


def project_bodies(bodies: Sequence[Body], camera: CameraMessage | None = None) -> tuple[ProjectedBody, ...]:
    """Returns performers as seen by their camera.

    If its position is unknown, a level camera in front of them is assumed.
    """
    if not bodies:
        return ()
    if camera is not None:
        return tuple(_project_body(camera, body) for body in bodies)
    nearest = max(float(body.joints[:, 2].max()) for body in bodies)
    eye = np.array([0.0, ASSUMED_CAMERA_HEIGHT, 0.0])
    if nearest > -_MIN_CAMERA_DISTANCE:
        middle = np.mean([body.joints.mean(0) for body in bodies], axis=0)
        eye = np.array([middle[0], ASSUMED_CAMERA_HEIGHT, nearest + _ASSUMED_CAMERA_DISTANCE])
    bodies_seen = []
    for body in bodies:
        offsets = body.joints - eye
        depth = -offsets[:, 2]
        half = np.where(depth > 0.0, depth, np.nan) * _TAN_HALF_FOV
        places = np.stack(
            [0.5 * (DEFAULT_ASPECT + offsets[:, 0] / half), 0.5 * (1.0 - offsets[:, 1] / half)], 1
        )
        bodies_seen.append(ProjectedBody(body.id, places, depth, body.confidence))
    return tuple(bodies_seen)


def _project_body(camera: CameraMessage, body: Body) -> ProjectedBody:
    """Returns a performer as seen by a camera with a known position."""
    rows, (across, down, right, low) = np.reshape(camera.place, (3, 4)), camera.lens
    ahead = (body.joints - rows[:, 3]) @ rows[:, :3]
    depth = np.where(ahead[:, 2] > 0.0, ahead[:, 2], np.nan)
    places = np.stack([across * ahead[:, 0] / depth + right, down * ahead[:, 1] / depth + low], 1)
    return ProjectedBody(body.id, places, ahead[:, 2], body.confidence, down)


class PreviewPlacement:
    """Chooses the corner of the inset. The inset stays in a corner until it would cover much less in another
    corner.
    """

    def __init__(self) -> None:
        self._corner, self._frame_count = 0, 0

    def place(
        self, width: float, height: float, views: float, covered: Callable[[], Sequence[Rectangle]]
    ) -> Rectangle:
        """Returns the inset's rectangle in a view with a width and height in pixels.

        Several cameras are side by side.

        Args:
            views: total width of the camera images, as a multiple of an image with aspect ratio
                :data:`DEFAULT_ASPECT`.
            covered: returns the rectangles of the characters in pixels. It is called only every few frames.
        """
        fits = min(
            _MAX_HEIGHT,
            _MAX_WIDTH_FRACTION * width / (DEFAULT_ASPECT * views),
            height - _BOTTOM_SPACE - _MARGIN,
        )
        tall = max(min(max(_HEIGHT_FRACTION * height, _MIN_HEIGHT), fits), 1.0)
        wide = tall * DEFAULT_ASPECT * views
        right, low = width - wide - _MARGIN, height - tall - _BOTTOM_SPACE
        corners = [(x, y, wide, tall) for x, y in ((right, low), (right, _MARGIN), (_MARGIN, low))]
        if self._frame_count % _CORNER_SEARCH_FRAMES == 0:
            rectangles = covered()
            costs = [
                sum(_measure_overlap(corner, rectangle) for rectangle in rectangles) / (wide * tall)
                for corner in corners
            ]
            best = int(np.argmin(costs))
            if costs[best] + _MIN_CORNER_GAIN < costs[self._corner]:
                self._corner = best
        self._frame_count += 1
        return corners[self._corner]


def find_rectangle(pixels: Float) -> Rectangle | None:
    """Returns the bounding rectangle of pixels (N, 2), or None if one is behind the camera."""
    if not len(pixels) or not np.isfinite(pixels).all():
        return None
    low, high = pixels.min(0), pixels.max(0)
    return float(low[0]), float(low[1]), float(high[0] - low[0]), float(high[1] - low[1])


def _measure_overlap(first: Rectangle, second: Rectangle) -> float:
    """Returns the area of the intersection of two rectangles in square pixels."""
    width = min(first[0] + first[2], second[0] + second[2]) - max(first[0], second[0])
    height = min(first[1] + first[3], second[1] + second[3]) - max(first[1], second[1])
    return max(width, 0.0) * max(height, 0.0)
