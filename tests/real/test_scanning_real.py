"""Tests of scanning on a real recording of a camera that was carried through a kitchen (7-Scenes).

Settings were chosen on its first 150 frames, and these tests use 60 of them. The reference poses come from
another fusion algorithm.
"""

import os
from dataclasses import replace
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from enliven.camera import LEVEL_WORLD_FROM_CAMERA
from enliven.person import Joint
from enliven.scanning import Scanner, ScanSettings, ScanState, VolumeSettings, find_ground, find_largest_part
from enliven_edge.importing.depth_images import OpenCvDepthReader
from enliven_edge.importing.placed_images import PosedDepthReader
from enliven_edge.scanning.person import PersonScanner

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
KITCHEN = DATA / "scans" / "sevenscenes_kitchen"
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not KITCHEN.is_dir(), reason="the real recordings (ENLIVEN_DATA) are not here"),
]


@cache
def scanned():
    """Returns the scanner after 60 frames, the result of each frame, and the recorded poses."""
    frames = list(islice(PosedDepthReader().read(sorted(KITCHEN.iterdir())), 60))
    scanner = Scanner(ScanSettings(volume=VolumeSettings(voxel=0.015, reach=5.0)))
    unposed = [frames[0], *(replace(frame, world_from_camera=None) for frame in frames[1:])]
    return scanner, [scanner.add(frame) for frame in unposed], [frame.world_from_camera for frame in frames]


def test_the_camera_is_found_in_a_real_kitchen():
    _, steps, truth = scanned()
    assert all(step.state is ScanState.SCANNING for step in steps)
    positions = np.array([step.world_from_camera[:3, 3] for step in steps])
    true_positions = np.array([pose[:3, 3] for pose in truth])
    a, b = positions - positions.mean(0), true_positions - true_positions.mean(0)
    u, _, v = np.linalg.svd(b.T @ a)
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    assert np.sqrt(np.square(a @ turn.T - b).sum(1).mean()) < 0.02
    assert np.linalg.norm(np.diff(true_positions, axis=0), axis=1).sum() > 0.5


def test_real_turning_person_is_scanned_all_round():
    frames = list(OpenCvDepthReader().read(sorted((DATA / "depth" / "uva_cv2_person_turn").iterdir())))
    volume = VolumeSettings(voxel=0.01, reach=1.6, far=1.6)
    scanner = Scanner(ScanSettings(volume=volume, least_depth=0.01))
    steps = [scanner.add(replace(frame, world_from_camera=None)) for frame in frames]
    assert len(steps) == 100 and all(step.state is ScanState.SCANNING for step in steps)
    ahead = np.array([step.world_from_camera[:3, 2] for step in steps])
    turned = np.degrees(np.unwrap(np.arctan2(ahead[:, 0], ahead[:, 2])))
    assert 330 < abs(turned[-1] - turned[0]) < 360  # about 345, from the person's chest in the same recording
    person = find_largest_part(scanner.extract_surface())
    assert person.area > 0.9 * scanner.extract_surface().area
    # The mesh is a single part: a head, and shoulders of human width.
    assert 0.3 < np.ptp(person.vertices[:, 0]) < 0.8 and 0.5 < np.ptp(person.vertices[:, 1]) < 1.0


def test_real_person_is_separated_from_the_room_and_has_joints():
    """The wall stays in the image, so the tracker has to find the person."""
    frames = list(OpenCvDepthReader().read(sorted((DATA / "depth" / "uva_cv2_person_turn").iterdir())))
    volume = VolumeSettings(voxel=0.01, reach=3.5, far=3.5)
    scanner = PersonScanner(ScanSettings(volume=volume, least_depth=0.01))
    states = [scanner.add(frame).state for frame in frames]
    assert states.count(ScanState.SCANNING) >= 95 and not scanner.absent
    person = scanner.finish_person()
    width, height, _ = np.ptp(person.mesh.vertices, axis=0)
    assert 0.35 < width < 0.65 and 0.6 < height < 0.9 and person.mesh.bounds[0, 1] == 0.0
    shoulders = person.joints[[Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT]]
    assert 0.25 < shoulders[0, 0] - shoulders[1, 0] < 0.45, "they face +Z, and left is left"
    assert 0.05 < person.joints[Joint.HEAD, 1] - shoulders[:, 1].mean() < 0.35
    assert not np.isfinite(person.joints[Joint.FOOT_LEFT]).any(), "legs are not in view"


def test_the_floor_of_the_kitchen_is_level():
    scanner, _, _ = scanned()
    down = np.loadtxt(KITCHEN / "gravity-direction.txt").reshape(-1)[:3]
    up = -LEVEL_WORLD_FROM_CAMERA[:3, :3] @ down / np.linalg.norm(down)
    ground = find_ground(scanner.extract_surface(), up)
    assert ground.normal @ up > np.cos(np.radians(4.0)) and ground.area > 0.3
