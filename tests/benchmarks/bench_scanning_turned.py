"""Measures object tracking of a chair on a turntable, and in two hands: pose error and mesh error.

The images are rendered with a Kinect's noise. Chair, rotation, hands and room are known. The first 1.5 s, in
which the chair stands still, and the whole turn are scanned at fifteen images per second. Parts of the mesh
more than a centimetre away from the chair count as remains of hands.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from chair_on_turntable import CAMERA_PATH, HELD, ROOM, SCANNED_OBJECT, SETTLED
from figure import Figure
from scipy.spatial import cKDTree

from enliven.meshes import Mesh
from enliven.scanning.decimation import distance_bounds
from enliven.scanning.objects.moved_scanner import MovedScanner, object_tracking_settings
from enliven.scanning.objects.moved_step import ObjectState
from enliven.scanning.objects.registration import align_from_starts
from enliven.scanning.objects.surface_points import make_nearest_grid, sample_surface
from enliven.scanning.rigid import invert_pose, pose_difference
from enliven.scanning.settings import ScanSettings
from enliven_synthesis.sensor.hand_turned_object import HandTurnedPath
from enliven_synthesis.sensor.handheld import HandheldPath
from enliven_synthesis.sensor.moved_object import MovedObjectScan, MovingObject
from enliven_synthesis.sensor.profile import load_profile

WAYS: dict[str, tuple[MovingObject, HandheldPath, int]] = {
    "turntable": (CAMERA_PATH, SETTLED, 405),
    "in_hands": (HandTurnedPath(), HELD, 465),
}
"""Paths of chair and camera, and the number of images at 30 per second, including the time before the
turn.
"""
EVERY = 2
"""Every second image is scanned, which shortens the run."""
NEAR = 0.01
"""A ground-truth point counts as scanned if the surface is within this distance, metres."""


def figures() -> Iterator[Figure]:
    """Yields the errors of the chair's pose and the camera's pose, the fraction of images used, and the mesh
    figures."""
    for name, (way, camera, images) in WAYS.items():
        take = MovedObjectScan(SCANNED_OBJECT, way, load_profile("kinect1"), camera, room=ROOM, width=640)
        yield from _measure_path(name, take, images)


def _measure_path(name: str, take: MovedObjectScan, images: int) -> Iterator[Figure]:
    """Yields the figures of one path."""
    scanner, off, room, took, followed = MovedScanner(object_tracking_settings(ScanSettings())), [], [], [], 0
    for index in range(0, images, EVERY):
        frame = take.frame(index)
        frame = frame if index else replace(frame, world_from_camera=take.pose(0))
        start = time.perf_counter()
        step = scanner.add(frame)
        took.append(time.perf_counter() - start)
        room.append(pose_difference(step.scan.world_from_camera, take.pose(index))[0])
        followed += step.state in (ObjectState.FOLLOWED, ObjectState.RESTING)
        if step.object_from_camera is not None:
            true = invert_pose(take.object_pose(index)) @ take.pose(index)
            off.append(pose_difference(step.object_from_camera, true)[0])
    yield Figure(f"scanning.{name}_ms", 1e3 * float(np.median(took)), "ms")
    yield Figure(f"scanning.{name}_p99_ms", 1e3 * float(np.quantile(took, 0.99)), "ms")
    yield Figure(f"scanning.{name}_followed", followed / len(took), "of the images")
    yield Figure(f"scanning.{name}_mm", 1e3 * float(np.median(off)), "mm of the camera about the chair")
    yield Figure(f"scanning.{name}_room_mm", 1e3 * max(room), "mm of the camera in the room, the most")
    yield from _measure_mesh(name, scanner.extract_object())


def _measure_mesh(name: str, made: Mesh) -> Iterator[Figure]:
    """Yields the distance of the aligned mesh from the chair, and the completeness."""
    middle = np.mean(SCANNED_OBJECT.bounds, axis=0) * [1, 0, 1]
    truth = replace(SCANNED_OBJECT, vertices=SCANNED_OBJECT.vertices - middle)
    grid = make_nearest_grid(sample_surface(truth, 60_000), 0.006, 0.1)
    ((pose,), _) = align_from_starts(
        grid, sample_surface(made, 8000), np.eye(4)[None], 25, 0.01, (0.05, 0.003)
    )
    made = replace(made, vertices=made.vertices @ pose[:3, :3].T + pose[:3, 3])
    error = distance_bounds(truth, sample_surface(made, 20_000).points)
    yield Figure(f"scanning.surface_mm_{name}", 1e3 * float(error.mean()), "mm")
    yield Figure(f"scanning.surface_mm_{name}_p95", 1e3 * float(np.quantile(error, 0.95)), "mm")
    yield Figure(f"scanning.too_much_{name}", float((error > NEAR).mean()), "of the mesh, hands and the like")
    tree = cKDTree(sample_surface(made, 200_000).points)
    is_near = tree.query(sample_surface(truth, 20_000).points)[0] < NEAR
    yield Figure(f"scanning.completeness_{name}", float(is_near.mean()), "of the surface, within 1 cm")
