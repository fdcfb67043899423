"""Reports the viewing direction to the edge, which uses it to rank matches. Also finds the best direction."""

from __future__ import annotations

import math

import numpy as np

from enliven.matching import views
from enliven.wire import Look
from enliven_viewer.render.camera import CameraView, OrbitCamera
from enliven_viewer.render.scene import Scene

_REPORT_INTERVAL_S = 0.1
"""Minimum time in seconds between two reports."""
_MIN_VISIBLE_FRACTION = 0.3
"""A chain of bones points at the camera if the projected length of its end-to-end vector is below this
fraction of its length.
"""
_ROTATION_TOLERANCE = 0.005
"""Change of a rotation matrix entry (about radians) below which the ranking of matches is assumed to stay the
same.
"""
_POSITION_TOLERANCE = 0.02
"""Camera movement in metres below which the ranking is assumed to stay the same."""


class ViewReporter:
    """Stores the last reported view, and decides when to report a new one."""

    def __init__(self) -> None:
        self._reported: CameraView | None = None
        self._report_time = -math.inf

    def find_change(self, view: CameraView, seconds: float) -> Look | None:
        """Returns the view to report at a wall-clock time in seconds, or None if it has not changed."""
        if seconds - self._report_time < _REPORT_INTERVAL_S:
            return None
        if self._reported is not None:
            rotation_change = np.abs(
                view.camera_from_world[:3, :3] - self._reported.camera_from_world[:3, :3]
            ).max()
            if (
                rotation_change < _ROTATION_TOLERANCE
                and np.abs(view.eye - self._reported.eye).max() < _POSITION_TOLERANCE
            ):
                return None
        self._reported, self._report_time = view, seconds
        return make_look(view)


def make_look(view: CameraView) -> Look:
    """Returns a camera view as a network message."""
    rows = view.camera_from_world[:3, :3]
    forward, up, eye = (tuple(float(x) for x in row) for row in (-rows[2], rows[1], view.eye))
    return Look(forward, up, eye)  # type: ignore[arg-type]


def is_end_on(scene: Scene, view: CameraView) -> bool:
    """Returns True if a candidate chain points at the camera, so that its direction is not visible."""
    rows = view.camera_from_world[:3, :3]
    for board in scene.boards.values():
        for row in board.rows if board.state == "choosing" else ():
            for line in row.lines:
                ahead = line.mean(0) - view.eye if len(line) else rows[0]
                screen_view = views.ScreenView(ahead, rows[1])
                if len(line) and views.is_end_on(line[-1:] - line[:1], screen_view, _MIN_VISIBLE_FRACTION)[0]:
                    return True
    return False


def turn_to_bones(camera: OrbitCamera, scene: Scene) -> None:
    """Rotates a camera to the view that shows most of all characters' bones (AniMesh, section 8)."""
    ends = [actor.pose.positions[actor.character.edges].astype(np.float64) for actor in scene.actors]
    vectors = np.concatenate([np.zeros((0, 3)), *(end[:, 1] - end[:, 0] for end in ends)])
    rows = camera.view(1.0).camera_from_world[:3, :3]
    best = views.find_best_view(vectors, views.ScreenView(-rows[2], rows[1]))
    back = -best.direction if best.direction[1] <= 0 else best.direction
    camera.face(math.atan2(back[0], back[2]), math.asin(float(np.clip(back[1], -1.0, 1.0))))
