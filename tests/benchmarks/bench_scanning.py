"""Measures scanning on two threads: times of fusion and tracking, and the errors of camera and surface.

The chair is rendered with a Kinect's noise from a hand-held path, and its ground truth is known. The kitchen
(7-Scenes) has poses from KinectFusion, which have errors as well. So for both scenes, the distance between
the images and the fused surface is reported. The kitchen is left out if the recordings are missing. Open3D's
VoxelBlockGrid fuses the same images of the chair, if it is installed.
"""

from __future__ import annotations

import itertools
import os
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from figure import Figure
from scipy.spatial import cKDTree

from enliven.camera import project
from enliven.frames import DepthFrame
from enliven.meshes import Mesh, load_mesh, save_mesh
from enliven.samples.shipped import load_sample
from enliven.scanning import (
    DepthPreparation,
    Scanner,
    ScanSettings,
    TsdfVolume,
    VolumeSettings,
    decimate,
    draw_mesh,
)
from enliven.scanning.objects.moved_scanner import MovedScanner
from enliven.scanning.objects.registration import align_from_starts
from enliven.scanning.objects.surface_points import make_nearest_grid, sample_surface
from enliven_edge.importing.placed_images import PosedDepthReader
from enliven_edge.stage.character_setup import create_mesh_actor
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan
from enliven_synthesis.sensor.moved_object import (
    FollowingPath,
    MovedObjectPath,
    MovedObjectScan,
    make_lying_on_back_pose,
)
from enliven_synthesis.sensor.profile import load_profile

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
PATH = HandheldPath(target=(0.0, 0.8, 0.15), radius=1.45, height=(0.6, 1.9), turns=1.1, seconds=15.0)
PERSON = 2.0
"""Maximum depth in metres in the images of the fusion-only benchmark, so that only the object remains. It is
as large as a person.
"""
NEAR = 0.005
"""A ground-truth point counts as scanned if the surface is within this distance, metres."""

LAID = (14.0, 17.0)
"""Time in which the chair is laid on its back (begin, end), seconds."""
LAID_PATH = FollowingPath(
    target=(0.0, 0.85, 0.15), radius=1.5, height=(0.6, 1.9), turns=2.2, seconds=32.0,
    later=(0.0, 0.4, 0.15), turning=LAID, nod=0.35,
)  # fmt: skip
LAID_EVERY = 2
"""Every second image is scanned: fifteen per second."""
LOOKS = 3
"""Minimum number of images, of every third, in which a ground-truth point must be visible to count."""


def figures() -> Iterator[Figure]:
    """Yields the fusion alone, the whole loop on the chair, and the camera path in the kitchen."""
    scan = HandheldScan(load_sample("chair"), load_profile("kinect1"), PATH)
    frames, truth = list(scan), [scan.pose(n) for n in range(scan.frames)]
    yield from _time_fusion(frames[::15], truth[::15])
    yield from _scan_chair(scan, frames, truth)
    yield from _scan_laid_chair(load_sample("chair"))
    folder = DATA / "scans" / "sevenscenes_kitchen"
    if folder.is_dir():
        posed = list(itertools.islice(PosedDepthReader().read(sorted(folder.iterdir())), 300))
        settings = ScanSettings(volume=VolumeSettings(voxel=0.01, reach=5.0))
        scanner, true_poses = Scanner(settings), [frame.world_from_camera for frame in posed]
        poses, _ = _estimate_poses(scanner, posed, true_poses[0])
        yield Figure(
            "scanning.ate_mm_kitchen_tracked", 1e3 * _compute_position_error(poses, true_poses), "mm"
        )
        scanner.close_loops()
        ours, theirs = _match_poses(scanner, posed, true_poses)
        yield Figure("scanning.ate_mm_kitchen", 1e3 * _compute_position_error(ours, theirs), "mm")
        images = {frame.time_ns: frame for frame in posed}
        fused = [images[time_ns] for time_ns, _ in scanner.poses]
        left, right = (_measure_gap(fused, poses, settings) for poses in (ours, theirs))
        yield Figure("scanning.kitchen_left_mm", 1e3 * left, "mm", "KinectFusion's poses", right / left)


def _time_fusion(frames: list[DepthFrame], truth: list[np.ndarray]) -> Iterator[Figure]:
    """Yields the milliseconds to fuse an image at 5 mm, including its preparation. Ours and Open3D's
    alternate.
    """
    depths = [np.where(frame.depth < 1000 * PERSON, frame.depth, 0).astype(np.uint16) for frame in frames]
    camera, settings = frames[0].intrinsics, VolumeSettings(voxel=0.005)
    volume = TsdfVolume(settings)
    preparation = DepthPreparation(camera, settings.noise, settings.near, settings.far)
    peer, ours, theirs = _prepare_open3d(camera), list[float](), list[float]()
    for depth, pose in zip(depths, truth, strict=True):
        start = time.perf_counter()
        volume.integrate(preparation.prepare(depth), pose)
        ours.append(time.perf_counter() - start)
        if peer is not None:
            start = time.perf_counter()
            peer(depth, pose)
            theirs.append(time.perf_counter() - start)
    # The first images allocate most of the blocks and compile the kernels.
    took = float(np.median(ours[3:]))
    ratio = float(np.median(theirs[3:])) / took if theirs else None
    yield Figure(
        "scanning.integrate_ms", 1e3 * took, "ms", "Open3D VoxelBlockGrid" if theirs else None, ratio
    )


def _prepare_open3d(camera):
    """Returns a function that fuses an image with Open3D's defaults at 5 mm, or None if it is not
    installed.
    """
    try:
        import open3d as o3d
    except (ImportError, OSError):
        return None
    core = o3d.core
    lens = [[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]]
    intrinsic = core.Tensor(lens, core.float64)
    grid = o3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight"), (core.float32, core.float32), ((1), (1)), 0.005, 16, 20_000
    )

    def fuse(depth, pose) -> None:
        image = o3d.t.geometry.Image(core.Tensor(depth))
        extrinsic = core.Tensor(np.linalg.inv(pose), core.float64)
        blocks = grid.compute_unique_block_coordinates(image, intrinsic, extrinsic, 1000.0, PERSON)
        grid.integrate(blocks, image, intrinsic, extrinsic, 1000.0, PERSON)

    return fuse


def _scan_chair(scan: HandheldScan, frames: list[DepthFrame], truth: list[np.ndarray]) -> Iterator[Figure]:
    """Measures the whole loop: times, the camera's error, and the surface's error."""
    scanner = Scanner()
    tracked = list[float]()
    align = scanner.tracker.align

    def timed(*arguments, **named):
        start = time.perf_counter()
        try:
            return align(*arguments, **named)
        finally:
            tracked.append(time.perf_counter() - start)

    scanner.tracker.align = timed
    poses, took = _estimate_poses(scanner, frames, truth[0])
    yield Figure("scanning.track_ms", 1e3 * float(np.median(tracked)), "ms")
    yield Figure("scanning.fps", 1.0 / float(np.median(took)), "1/s")
    yield Figure("scanning.ate_mm_object", 1e3 * _compute_position_error(poses, truth), "mm")
    start = time.perf_counter()
    closed = scanner.close_loops()
    yield Figure("scanning.close_s", time.perf_counter() - start, "s")
    if closed is not None and closed.taken:
        poses, truth = _match_poses(scanner, frames, truth)
    meshed = time.perf_counter()
    thing = scanner.extract_object()
    yield Figure("scanning.mesh_s", time.perf_counter() - meshed, "s")
    reduced = decimate(thing, 50_000)
    with tempfile.TemporaryDirectory() as folder:
        save_mesh(reduced.mesh, Path(folder) / "chair.glb")
        create_mesh_actor(load_mesh(Path(folder) / "chair.glb").mesh, "chair").warm_up()
    yield Figure("scanning.to_possess_s", time.perf_counter() - start, "s")
    yield Figure("scanning.triangles", float(len(thing.faces)), "triangles")
    yield Figure("scanning.decimated_mm", 1e3 * reduced.mean, "mm")
    yield Figure("scanning.mb", scanner.megabytes, "MB")
    turn, move = _align_points(np.array([p[:3, 3] for p in poses]), np.array([p[:3, 3] for p in truth]))
    surface = scanner.extract_surface()
    near = _find_object_faces(Mesh(surface.vertices @ turn.T + move, surface.faces), scan.scanned_mesh)
    points = _sample_surface(scan.scanned_mesh, 600_000)
    error = _compute_errors(near, points)
    yield Figure("scanning.surface_mm", 1e3 * float(error.mean()), "mm")
    yield Figure("scanning.surface_mm_p95", 1e3 * float(np.quantile(error, 0.95)), "mm")
    # A million samples are closer together than NEAR. With a tenth of them, an eighth of a complete surface
    # would seem missing.
    is_near = cKDTree(_sample_surface(near, 1_000_000)[0]).query(points[0][::12])[0] < NEAR
    is_seen = _find_visible(scan, points[0][::12], points[1][::12])
    yield Figure("scanning.completeness", float(is_near[is_seen].mean()), "of the visible surface")
    yield Figure("scanning.completeness_all", float(is_near.mean()), "of the surface, undersides included")


def _scan_laid_chair(chair: Mesh) -> Iterator[Figure]:
    """Measures a scan in which the chair is laid on its back half-way: the mesh's completeness and error."""
    poses = [np.eye(4), make_lying_on_back_pose(chair, (0.0, 0.15))]
    way = MovedObjectPath(poses, [LAID], grips=[(-0.2, 1.5, -0.05), (0.25, 0.6, 0.2)])
    scan, scanner = MovedObjectScan(chair, way, load_profile("kinect1"), LAID_PATH), MovedScanner()
    again, off = None, list[float]()
    for index in range(0, scan.frames, LAID_EVERY):
        frame = replace(scan.frame(index), world_from_camera=None if index else scan.pose(0))
        step, time_s = scanner.add(frame), index / 30.0
        if step.object_from_camera is not None and time_s > LAID[0] + 1.0:
            again = time_s if again is None else again
            true = np.linalg.inv(scan.object_pose(index)) @ scan.pose(index)
            off.append(float(np.linalg.norm(step.object_from_camera[:3, 3] - true[:3, 3])))
    yield Figure(
        "scanning.found_again_s", (again or np.inf) - LAID[1], "s of the camera's clock after it lay"
    )
    yield Figure("scanning.found_again_mm", 1e3 * float(np.median(off)) if off else np.inf, "mm")
    start = time.perf_counter()
    scanner.close_loops()
    mesh = scanner.merge_surfaces()
    yield Figure("scanning.join_s", time.perf_counter() - start, "s")
    points = _sample_surface(chair, 600_000)
    # The first image has the true pose, but the later path drifts, so the surfaces are aligned first.
    grid = make_nearest_grid(sample_surface(chair, 60_000), 0.006, 0.1)
    ((pose,), _) = align_from_starts(
        grid, sample_surface(mesh, 8000), np.eye(4)[None], 25, 0.01, (0.05, 0.003)
    )
    mesh = Mesh(mesh.vertices @ pose[:3, :3].T + pose[:3, 3], mesh.faces)
    error = _compute_errors(mesh, points)
    yield Figure("scanning.surface_mm_laid", 1e3 * float(error.mean()), "mm")
    yield Figure("scanning.surface_mm_laid_p95", 1e3 * float(np.quantile(error, 0.95)), "mm")
    there = cKDTree(_sample_surface(mesh, 1_000_000)[0]).query(points[0][::12])[0] < NEAR
    yield Figure("scanning.completeness_laid", float(there.mean()), "of the surface, undersides included")


def _compute_errors(mesh: Mesh, points: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Returns the distances, metres, from points on a mesh to the true surface, given as points and
    normals."""
    surface = _sample_surface(mesh, 100_000)
    distance, at = cKDTree(points[0]).query(surface[0])
    flat = np.abs(((surface[0] - points[0][at]) * points[1][at]).sum(1))
    # Samples of the truth are 2 mm apart. At short distances, point-to-plane is more accurate than
    # point-to-point.
    return np.where(distance < 0.006, np.minimum(flat, distance), distance)


def _find_visible(scan: HandheldScan, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Returns which points (N, 3) of the object are visible, without occlusion, in at least LOOKS of every
    third image."""
    camera, looks = scan.intrinsics, np.zeros(len(points), int)
    for index in range(0, scan.frames, 3):
        pose = scan.pose(index)
        local = (points - pose[:3, 3]) @ pose[:3, :3]
        column, row = np.rint(project(local, camera)).astype(int).T
        shown = np.flatnonzero((column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height))
        ray = local[shown] / np.linalg.norm(local[shown], axis=1, keepdims=True)
        slope = np.abs((ray * (normals[shown] @ pose[:3, :3])).sum(1))
        before = local[shown, 2] - draw_mesh(scan.scanned_mesh, camera, pose).depth[row[shown], column[shown]]
        # A pixel covers 3 mm there, and a larger range of depth the more slanted the surface is.
        looks[shown[before < 0.004 + 0.003 / np.maximum(slope, 0.1)]] += 1
    return looks >= LOOKS


def _estimate_poses(
    scanner: Scanner, frames: list[DepthFrame], first: np.ndarray
) -> tuple[list[np.ndarray], list[float]]:
    """Returns the estimated poses of frames without poses (except the first), and the seconds for each
    frame.
    """
    poses, took = [], []
    for n, frame in enumerate(frames):
        posed_frame = DepthFrame(
            frame.depth, frame.intrinsics, frame.time_ns, frame.sensor, world_from_camera=None if n else first
        )
        start = time.perf_counter()
        step = scanner.add(posed_frame)
        took.append(time.perf_counter() - start)
        poses.append(step.world_from_camera)
    return poses, took


def _match_poses(
    scanner: Scanner, frames: list[DepthFrame], truth: list[np.ndarray]
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Returns the final poses of the fused frames, and the true ones."""
    true = {frame.time_ns: pose for frame, pose in zip(frames, truth, strict=True)}
    return [pose for _, pose in scanner.poses], [true[time_ns] for time_ns, _ in scanner.poses]


def _measure_gap(frames: list[DepthFrame], poses: list[np.ndarray], settings: ScanSettings) -> float:
    """Returns the distance, metres, between the images and the surface fused from them at the given poses."""
    scanner = Scanner(settings)
    for frame, pose in zip(frames, poses, strict=True):
        scanner.place(frame, pose)
    judged = (
        scanner.tracker.evaluate(scanner.prepare_view(frame), pose)
        for frame, pose in zip(frames, poses, strict=True)
    )
    return float(np.mean([match.error for match in judged]))


def _align_points(these: np.ndarray, those: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the rotation and translation that align points (N, 3) with other points (Kabsch)."""
    a, b = these - these.mean(0), those - those.mean(0)
    u, _, v = np.linalg.svd(b.T @ a)
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    return turn, those.mean(0) - turn @ these.mean(0)


def _compute_position_error(found: list[np.ndarray], truth: list[np.ndarray]) -> float:
    """Returns the root mean square error of the camera positions, metres, after aligning the paths."""
    these, those = (np.array([pose[:3, 3] for pose in poses]) for poses in (found, truth))
    turn, move = _align_points(these, those)
    return float(np.sqrt(np.square(these @ turn.T + move - those).sum(1).mean()))


def _find_object_faces(mesh: Mesh, thing: Mesh) -> Mesh:
    """Returns the faces of a scan that belong to the object instead of the floor."""
    low, high = thing.bounds
    inside = ((mesh.vertices > low - [0.05, -0.02, 0.05]) & (mesh.vertices < high + 0.05)).all(1)
    return mesh.with_faces(inside[mesh.faces].all(1))


def _sample_surface(mesh: Mesh, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns evenly distributed points on a surface, and the normals there."""
    random, areas = np.random.default_rng(0), np.linalg.norm(mesh.face_vectors(), axis=1)
    face = random.choice(len(areas), count, p=areas / areas.sum())
    root, other = np.sqrt(random.random((count, 1))), random.random((count, 1))
    shares = np.concatenate([1 - root, root * (1 - other), root * other], 1)
    return (mesh.vertices[mesh.faces[face]] * shares[..., None]).sum(1), mesh.face_normals()[face]
