"""Placement of a growing scan on the stage: its floor at y = 0, its centre above the origin."""

from __future__ import annotations

import time
from contextlib import suppress

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.scanning import GroundPlane, Scanner, extract_surface, find_focus, find_ground, upright_frame
from enliven_edge.scanning.next_best_view import find_next_view
from enliven_edge.scanning.scan_view import ScanView

_SEARCH_INTERVAL_S = 1.0
"""Seconds between two searches for floor, centre and gaps in the whole scan. Each search takes 0.15 s."""
_DEFAULT_CAMERA_HEIGHT_M = 1.2
"""Assumed camera height above the floor in metres until the floor is seen."""
_ASSUMED_GROUND = GroundPlane(np.array([0.0, 1.0, 0.0]), -_DEFAULT_CAMERA_HEIGHT_M, 0.0)
_MIN_MOTION_M = 0.03
"""Minimum motion in metres of the floor or the centre that moves the placement. Smaller motions would make
the view jitter."""
_SETTLING_IMAGES = 30
"""Number of images until the centre is fixed. Before, the camera may still approach the object."""


class ScanPlacement:
    """Floor, centre and missing part of a scan. They are updated periodically.

    Attributes:
        stage_from_scan: (4, 4) transform to the stage from the current room, which contains the camera.
        missing: fraction of the surface near the centre that was not seen.
        view: six coordinates in metres on the stage: camera position and target of the next best view; empty
            if there is none.
    """

    def __init__(self) -> None:
        self.stage_from_scan = np.eye(4)
        self.stage_from_scan[1, 3] = _DEFAULT_CAMERA_HEIGHT_M
        self.missing, self.view = 1.0, list[float]()
        self._updated_at, self._found, self._places = 0.0, False, 1
        self._ground, self._ground_images = _ASSUMED_GROUND, 0
        self._room_from_shown: Float = np.eye(4)

    def update(self, shown: ScanView) -> None:
        """Updates floor, centre and next best view if the last update is old enough."""
        now, scanner = time.monotonic(), shown.room_scanner
        is_changed = shown.places != self._places
        if (
            scanner is None
            or not scanner.poses
            or (now - self._updated_at < _SEARCH_INTERVAL_S and not is_changed)
        ):
            return
        self._updated_at = now
        if is_changed:
            self._places, self._found = shown.places, False
            self._ground, self._ground_images = _ASSUMED_GROUND, 0
        mesh, poses = extract_surface(scanner.volumes[1]), [pose for _, pose in scanner.poses]
        focus, ground = find_focus(poses), shown.ground or self._find_ground(scanner, mesh)
        if shown.alone:
            mesh = shown.mesh()
            focus = np.asarray(mesh.bounds.mean(0)) if len(mesh.vertices) else focus
        self._room_from_shown = np.asarray(np.linalg.inv(shown.shown_from_room), np.float64)
        self._move_placement(ground, focus, len(poses))
        camera_distance = float(np.median([np.linalg.norm(pose[:3, 3] - focus) for pose in poses]))
        best_view = find_next_view(mesh, ground, focus, camera_distance)
        self.missing, self.view = min(best_view.missing, 1.0), []
        if best_view.eye is not None:
            self.view = [*self._on_stage(best_view.eye), *self._on_stage(focus)]

    def _find_ground(self, scanner: Scanner, mesh: Mesh) -> GroundPlane:
        """Returns the floor under a room's surface, in the room's frame.

        The frame does not change when images are undone. So a floor that was found in more images is kept. It
        is better than a floor from the few remaining images, and better than the assumed floor. So neither
        the placement nor the crop box jumps.
        """
        images = len(scanner.poses)
        if images >= self._ground_images:
            with suppress(InputError):
                self._ground = find_ground(mesh)
                self._ground_images = images
        return self._ground

    def rows(self, pose: Float | None = None) -> list[float]:
        """Returns the first three rows (3, 4) of the transform from a room to the stage, as twelve numbers.

        ``pose`` (4, 4) is the pose of the room, or None for the room of the shown surface.
        """
        stage_from_shown = self.stage_from_scan @ (self._room_from_shown if pose is None else pose)
        return [float(x) for x in stage_from_shown[:3].ravel()]

    def _on_stage(self, point: Float) -> list[float]:
        return [float(x) for x in self.stage_from_scan[:3, :3] @ point + self.stage_from_scan[:3, 3]]

    def _move_placement(self, ground: GroundPlane, focus: Float, images: int) -> None:
        """Moves the floor to y = 0 and the centre above the origin, if they moved."""
        wanted_frame = upright_frame(ground, focus)
        rotation = wanted_frame[:3, :3]
        if self._found and images > _SETTLING_IMAGES:
            # Keep the centre fixed, and follow only the floor.
            kept_origin = np.linalg.inv(self.stage_from_scan) @ [0.0, 0.0, 0.0, 1.0]
            wanted_frame[[0, 2], 3] = -(rotation @ kept_origin[:3])[[0, 2]]
        corners = np.array([[0, 0, 0, 1], [1, 0, 0, 1], [0, 0, 1, 1]], float)
        corner_motion = corners @ (wanted_frame - self.stage_from_scan).T
        if not self._found or np.linalg.norm(corner_motion, axis=1).max() > _MIN_MOTION_M:
            self.stage_from_scan, self._found = wanted_frame, True
