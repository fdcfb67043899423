"""Tests of rendering hand-held scans: triangles are drawn where rays hit them, and the path is realistic."""

import numpy as np

from enliven.camera import Intrinsics
from enliven.meshes import Mesh
from enliven.scanning import draw_mesh
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan, look_at_pose
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.scene import Box, cast_room

CAMERA = Intrinsics(160, 120, 150.0, 150.0, 79.5, 59.5)
CORNERS = np.array([[k & 1, k >> 1 & 1, k >> 2] for k in range(8)], float)
SIDES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
FACES = np.array([face for a, b, c, d in SIDES for face in ((a, b, c), (a, c, d))], np.int32)


def box_mesh(box: Box) -> Mesh:
    """Returns the twelve triangles of a box."""
    low, high = np.array(box.low), np.array(box.high)
    return Mesh(low + CORNERS * (high - low), FACES, colours=np.full((8, 3), 90, np.uint8))


def test_a_drawn_box_is_the_cast_one():
    box = Box((-0.3, 0.0, -0.2), (0.25, 0.5, 0.3))
    for eye in ([1.2, 0.9, 1.0], [-0.7, 0.2, 1.4], [0.1, 2.0, 0.2]):
        pose = look_at_pose(np.array(eye), np.array([0.0, 0.2, 0.0]))
        cast, _ = cast_room(CAMERA, pose, (box,))
        drawn = draw_mesh(box_mesh(box), CAMERA, pose)
        both = np.isfinite(cast) & np.isfinite(drawn.depth)
        # Edge pixels may belong to either triangle. All other pixels are equal up to rounding.
        assert (np.isfinite(cast) != np.isfinite(drawn.depth)).sum() < 20 and both.sum() > 500
        np.testing.assert_allclose(drawn.depth[both], cast[both], atol=1e-9)
        mesh, at = box_mesh(box), drawn.face[both]
        points = (mesh.vertices[mesh.faces[at]] * drawn.barycentric[both][..., None]).sum(1)
        local = (points - pose[:3, 3]) @ pose[:3, :3]
        np.testing.assert_allclose(local[:, 2], cast[both], atol=1e-9)


def test_a_scan_is_the_same_again_and_looks_at_its_target():
    box = box_mesh(Box((-0.2, 0.0, -0.2), (0.2, 0.8, 0.2)))
    path = HandheldPath(target=(0.0, 0.4, 0.0), seconds=2.0)
    scans = [HandheldScan(box, load_profile("kinect1"), path, width=160, colour=True) for _ in range(2)]
    first, second = (scan.frame(7) for scan in scans)
    assert (first.depth == second.depth).all() and (first.colour == second.colour).all()
    assert first.world_from_camera is None  # the frame does not state its camera pose
    for index in range(0, 60, 10):
        pose = scans[0].pose(index)
        local = (np.array([0.0, 0.4, 0.0]) - pose[:3, 3]) @ pose[:3, :3]
        assert abs(local[0] / local[2]) < 0.15 and abs(local[1] / local[2]) < 0.15
        assert pose[1, 1] < 0  # upright
    moves = [np.linalg.norm(scans[0].pose(i + 1)[:3, 3] - scans[0].pose(i)[:3, 3]) for i in range(59)]
    assert max(moves) < 0.2 and scans[0].frames == 60


def test_without_noise_the_depth_is_that_of_the_surface_to_a_millimetre():
    box = box_mesh(Box((-0.2, 0.0, -0.2), (0.2, 0.8, 0.2)))
    scan = HandheldScan(box, load_profile("kinect1"), HandheldPath(seconds=2.0), width=160, noise=False)
    exact = draw_mesh(box, scan.intrinsics, scan.pose(3)).depth
    near = np.isfinite(exact)
    assert near.sum() > 300
    assert np.abs(scan.frame(3).depth[near] * 1e-3 - exact[near]).max() <= 0.00051
