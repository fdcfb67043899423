"""Tests of loop closure: after drift in a large room, each surface occurs only once."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial import cKDTree

from enliven import rotation
from enliven.samples.shipped import load_sample
from enliven.scanning import Scanner, ScanSettings, ScanState, VolumeSettings
from enliven.scanning.loop_closure.history import FrameHistory
from enliven.scanning.loop_closure.pose_graph import optimize_poses
from enliven.scanning.rigid import invert_pose, move_pose, pose_difference
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan, look_at_pose
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.scene import Box

pytestmark = pytest.mark.slow

FRAMES = 90
VOXEL = 0.02
SETTINGS = ScanSettings(volume=VolumeSettings(voxel=VOXEL, reach=5.0))
DRIFT = np.array([0.06, 0.02, -0.08, 0.004, 0.015, -0.004])
"""Final tracking drift, which grows linearly from 0: translation in metres, rotation in radians."""


@dataclass(frozen=True)
class Round(HandheldPath):
    """A level circular path; the camera looks outward and slightly ahead."""

    def world_from_camera(self, time):
        angle, unrest = 2 * np.pi * self.turns * time / self.seconds, self._hand_motion(time)
        eye = np.array([self.radius * np.sin(angle), 1.2, self.radius * np.cos(angle)])
        eye += self.sway * unrest[:3]
        pose = look_at_pose(eye, eye + np.array([np.sin(angle + 0.6), -0.25, np.cos(angle + 0.6)]))
        shake = rotation.to_matrix(rotation.from_rotation_vector(self.shake * unrest[3:]))
        pose[:3, :3] = pose[:3, :3] @ shake
        return pose


def hall():
    """Returns a floor, four walls, and two rings of 36 boxes along them."""
    random, boxes = np.random.default_rng(5), [Box((-8, -0.2, -8), (8, 0, 8))]
    for far, near in ((-5.2, -5.0), (5.0, 5.2)):
        boxes += [Box((far, 0, -6), (near, 2.6, 6)), Box((-6, 0, far), (6, 2.6, near))]
    for ring, wide, high in ((4.3, 0.6, 2.4), (3.3, 0.3, 1.2)):
        for n in range(36):
            angle, radius = 2 * np.pi * (n + (ring < 4) / 2) / 36, ring + random.uniform(-0.5, 0.3)
            x, z = radius * np.sin(angle), radius * np.cos(angle)
            w, d, h = random.uniform([wide / 3, wide / 3, high / 4], [wide, wide, high])
            boxes.append(Box((x - w / 2, 0, z - d / 2), (x + w / 2, h, z + d / 2)))
    return tuple(boxes)


@pytest.fixture(scope="module")
def frames():
    """Renders the camera's images of 1.12 rounds. Returns them with their true poses."""
    path = Round(radius=2.0, turns=1.12, seconds=FRAMES / 30)
    take = HandheldScan(load_sample("chair"), load_profile("kinect1"), path, room=hall(), width=240)
    return [take.frame(n) for n in range(FRAMES)], [take.pose(n) for n in range(FRAMES)]


def drifted(frames, truth, drift=DRIFT, settings=SETTINGS):
    """Returns a scanner that fused the frames at drifting poses."""
    scanner = Scanner(settings)
    for n, (frame, pose) in enumerate(zip(frames, truth, strict=True)):
        scanner._fuse_image(
            frame, scanner.prepare_view(frame), move_pose(pose, drift * n / len(frames)), None, None
        )
    return scanner


def off(scanner, truth):
    """Returns the root mean square error of the camera positions, metres, after aligning both paths."""
    these, those = (np.array(ways)[:, :3, 3] for ways in ([p for _, p in scanner.poses], truth))
    a, b = these - these.mean(0), those - those.mean(0)
    u, _, v = np.linalg.svd(b.T @ a)
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    return np.sqrt(np.square(a @ turn.T - b).sum(1).mean())


def doubled(mesh):
    """Returns the fraction of the surface with a second layer 2 to 8 voxels away that faces the same way."""
    random, normals = np.random.default_rng(0), mesh.face_normals()
    areas, middles = np.linalg.norm(mesh.face_vectors(), axis=1), mesh.vertices[mesh.faces].mean(1)
    chosen, doubled_count = random.choice(len(areas), 3000, p=areas / areas.sum()), 0
    for face, near in zip(chosen, cKDTree(middles).query_ball_point(middles[chosen], 8 * VOXEL), strict=True):
        away = middles[near] - middles[face]
        deep = away @ normals[face]
        beside = np.linalg.norm(away - deep[:, None] * normals[face], axis=1)
        other = (np.abs(deep) > 2 * VOXEL) & (beside < VOXEL) & (normals[near] @ normals[face] > 0.9)
        doubled_count += bool(other.any())
    return doubled_count / len(chosen)


@pytest.fixture(scope="module")
def closed(frames):
    """Closes the loop. Returns the scanner, the closure, and the errors and duplication before it."""
    scanner = drifted(*frames)
    before = off(scanner, frames[1]), doubled(scanner.extract_surface()), len(scanner.keyframes)
    return scanner, scanner.close_loops(), before


def test_returning_path_is_closed_and_fused_again(frames, closed):
    scanner, closing, (before, twice, keyframes) = closed
    assert before > 0.015 and twice > 0.01, "it is doubled before"
    assert closing.taken and closing.loops >= 4 and closing.gap > 0.05
    assert off(scanner, frames[1]) < 0.6 * before and doubled(scanner.extract_surface()) < 0.2 * twice
    # The first pose is unchanged, and the last one agrees with the first round.
    np.testing.assert_allclose(scanner.poses[0][1], frames[1][0], atol=1e-9)
    assert pose_difference(scanner.poses[-1][1], frames[1][-1])[0] < 0.03
    assert 0 < len(scanner.keyframes) <= keyframes + 2
    # A closed loop does not change any more, and scanning continues from there.
    volumes = scanner.volumes
    assert not scanner.close_loops().taken and scanner.volumes is volumes
    assert scanner.add(frames[0][-1]).state is ScanState.SCANNING


def test_accepted_loops_are_correct(frames, closed):
    closing = closed[1]
    anchors = [piece.anchor for piece in closing.pieces]
    _, belief = optimize_poses([closing.poses[n] for n in anchors], closing.links)
    pairs = zip(closing.links, belief, strict=True)
    believed = [link for link, trust in pairs if not link.sure and trust > 0.5]
    assert len(believed) >= 4
    for link in believed:
        seen = invert_pose(frames[1][anchors[link.first]]) @ frames[1][anchors[link.second]]
        move, turn = pose_difference(seen, link.first_from_second)
        assert move < 0.04 and turn < 0.02


def test_open_path_is_unchanged(frames):
    scanner = drifted(*(part[: FRAMES // 3] for part in frames))
    poses = list(scanner.poses)
    closing = scanner.close_loops()
    assert not closing.taken and scanner.poses == poses
    assert Scanner(SETTINGS).close_loops() is None


def test_images_that_grow_too_large_are_thinned(frames):
    history = FrameHistory(0.4)
    for n, frame in enumerate(frames[0][:60]):
        history.add(n, frame)
    numbers = history.numbers
    assert history.megabytes <= 0.4 and 10 < len(history) < 60
    assert set(np.diff(numbers)) == {numbers[1] - numbers[0]} and numbers[0] == 0 and numbers[-1] > 50
    for number, frame in history.frames([numbers[3]]):
        assert number == numbers[3] and (frame.depth == frames[0][number].depth).all()
