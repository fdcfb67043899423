"""Measures scans of objects that were never used for tuning, with Kinect noise: errors of surface and camera.

A stool, a bear of round parts and a plant with leaves 2 mm thick are rendered at 640 x 480 from a hand-held
path, ten images per second. Shape and path are known.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from figure import Figure
from scanned_things import SCANNED_OBJECTS
from scipy.spatial import cKDTree

from enliven.meshes import Mesh
from enliven.scanning import Scanner, ScanState
from enliven.scanning.decimation import distance_bounds
from enliven.scanning.objects.surface_points import sample_surface
from enliven.scanning.rigid import pose_difference
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan
from enliven_synthesis.sensor.profile import load_profile

PATH = HandheldPath(target=(0.0, 0.3, 0.0), radius=1.0, height=(0.3, 1.1), turns=1.1, seconds=15.0)
EVERY = 3
"""Every third image is scanned, which shortens the run."""
NEAR = 0.005
"""A ground-truth point counts as scanned if the surface is within this distance, metres."""


def figures() -> Iterator[Figure]:
    """Yields the camera's error, the surface's error, and the completeness, of each object."""
    for name, make in SCANNED_OBJECTS.items():
        take, scanner = HandheldScan(make(), load_profile("kinect1"), PATH), Scanner()
        off, lost = list[float](), 0
        for index in range(0, take.frames, EVERY):
            frame = take.frame(index)
            step = scanner.add(frame if index else replace(frame, world_from_camera=take.pose(0)))
            lost += step.state is not ScanState.SCANNING
            off.append(pose_difference(step.world_from_camera, take.pose(index))[0])
        scanner.close_loops()
        yield Figure(f"scanning.off_mm_{name}", 1e3 * float(np.median(off)), "mm of the camera")
        yield Figure(f"scanning.left_out_{name}", float(lost), "images")
        yield from _measure_surface(name, take.scanned_mesh, scanner.extract_surface())


def _measure_surface(name: str, truth: Mesh, whole: Mesh) -> Iterator[Figure]:
    """Yields the distance between the scan and the object, above the floor, and the completeness."""
    low, high = truth.bounds
    inside = ((whole.vertices > low - [0.05, -0.02, 0.05]) & (whole.vertices < high + 0.05)).all(1)
    inner = whole.with_faces(inside[whole.faces].all(1))
    error = distance_bounds(truth, sample_surface(inner, 20_000).points)
    yield Figure(f"scanning.surface_mm_{name}", 1e3 * float(error.mean()), "mm")
    yield Figure(f"scanning.surface_mm_{name}_p95", 1e3 * float(np.quantile(error, 0.95)), "mm")
    is_near = (
        cKDTree(sample_surface(inner, 400_000).points).query(sample_surface(truth, 20_000).points)[0] < NEAR
    )
    yield Figure(
        f"scanning.completeness_{name}", float(is_near.mean()), "of the surface, undersides included"
    )
