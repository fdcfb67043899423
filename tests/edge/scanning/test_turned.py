"""Tests that all sides of a chair are scanned by a still camera while the chair turns or is turned by
hand.
"""

from dataclasses import replace

import numpy as np
import pytest
import typer
from chair_on_turntable import LEVEL, ROOM
from chair_on_turntable import SCANNED_OBJECT as SMALL
from typer.testing import CliRunner

from enliven import rotation
from enliven.meshes import load_mesh
from enliven.recording import Recorder
from enliven.samples.shipped import load_sample
from enliven.scanning import (
    Scanner,
    ScanSettings,
    ScanState,
    VolumeSettings,
    find_largest_part,
    settings_within,
)
from enliven.scanning.decimation import distance_bounds
from enliven.scanning.objects.registration import align_from_starts
from enliven.scanning.objects.surface_points import make_nearest_grid, sample_surface
from enliven.scanning.rigid import invert_pose
from enliven_edge.commands.scan import scan
from enliven_synthesis.sensor.hand_turned_object import HandTurnedPath
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan
from enliven_synthesis.sensor.moved_object import MovedObjectScan
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.scene import Box

WALL = (Box((-3.0, -1.0, -2.4), (3.0, 3.0, -2.0)),)
STILL = HandheldPath(target=(0.0, 0.88, 0.0), radius=1.45, height=(1.4, 1.4), turns=0.0, sway=0.0, shake=0.0)
FRAMES = 72
STEP = 2.2 * np.pi / FRAMES
"""Radians per frame: 1.1 turns in little more than two seconds."""
CHAIR = load_sample("chair")
THING = replace(CHAIR, vertices=CHAIR.vertices - np.mean(CHAIR.bounds, axis=0) * [1, 0, 1])


def turn(index):
    """Returns the object's (3, 3) rotation in a frame."""
    return rotation.to_matrix(rotation.from_rotation_vector([0.0, STEP * index, 0.0]))


@pytest.fixture(scope="module")
def frames():
    """Returns the still camera's pose and its frames."""
    take = HandheldScan(THING, load_profile("kinect1"), STILL, room=WALL, width=320)
    turned = (replace(THING, vertices=THING.vertices @ turn(index).T) for index in range(FRAMES))
    return take.pose(0), [take.frame(index, thing) for index, thing in enumerate(turned)]


@pytest.mark.slow
def test_object_turning_before_a_wall_is_scanned_from_all_sides(frames):
    pose, images = frames
    volume = VolumeSettings(voxel=0.008, reach=2.2, far=2.2)
    scanner = Scanner(ScanSettings(volume=volume, least_depth=0.01))
    steps = [scanner.add(image) for image in [replace(images[0], world_from_camera=pose), *images[1:]]]
    assert all(step.state is ScanState.SCANNING for step in steps)
    # In the object's frame, the camera moved around it in the opposite direction.
    apart = [
        np.linalg.norm(turn(n).T @ pose[:3, 3] - step.world_from_camera[:3, 3])
        for n, step in enumerate(steps)
    ]
    assert max(apart) < 0.025 and apart[-1] < 0.015, "the way closes"
    surface = scanner.extract_surface()
    error = distance_bounds(THING, surface.vertices)
    assert error.mean() < 0.004 and np.quantile(error, 0.95) < 0.012


@pytest.mark.slow
def test_within_option_cuts_off_the_background(frames, tmp_path):
    app, target = typer.Typer(pretty_exceptions_enable=False), tmp_path / "thing.glb"
    app.command()(scan)
    with Recorder(tmp_path / "turned.mcap") as recorder:
        for frame in frames[1][:12]:
            recorder.write_frame(frame)
    words = ["--recording", str(tmp_path / "turned.mcap"), "-o", str(target), "--voxel", "10"]
    result = CliRunner().invoke(app, [*words, "--within", "2.2"])
    assert result.exit_code == 0 and "from 12 frames" in result.output, result.output
    mesh = load_mesh(target).mesh
    assert mesh.vertices[:, 1].min() == pytest.approx(0.0, abs=1e-6)
    size = np.ptp(mesh.vertices, axis=0)
    assert np.abs(mesh.vertices).max() < 2.0 and size[0] < 1.0 and size[2] < 1.0, "the wall is not in it"


HELD_UP = HandTurnedPath(begins=-1.5, lift=0.6, behind=0.55)
"""Motion of an object that a person behind it holds up and turns once, changing their grip."""
WITHIN = 1.8
"""Depth limit in metres. The object is nearer, the person is farther away."""


@pytest.mark.slow
def test_object_turned_in_two_hands_is_scanned_without_hands():
    take = MovedObjectScan(SMALL, HELD_UP, load_profile("kinect1"), LEVEL, room=ROOM, width=640)
    scanner, steps = Scanner(settings_within(VolumeSettings(voxel=0.006), WITHIN)), []
    for index in range(0, 240, 3):
        frame = take.frame(index)
        true = invert_pose(take.object_pose(index)) @ take.pose(index)
        steps.append(scanner.add(frame if index else replace(frame, world_from_camera=true)))
    states = [step.state for step in steps]
    assert states.count(ScanState.SCANNING) > 0.95 * len(states)
    mesh = find_largest_part(scanner.extract_surface())
    # A hand covers the object in some images. Other images measure free space there.
    grid = make_nearest_grid(sample_surface(SMALL, 30_000), 0.01, 0.1)
    ((pose,), _) = align_from_starts(
        grid, sample_surface(mesh, 4000), np.eye(4)[None], 25, 0.01, (0.05, 0.003)
    )
    error = distance_bounds(SMALL, sample_surface(mesh, 6000).points @ pose[:3, :3].T + pose[:3, 3])
    assert error.mean() < 0.004 and (error > 0.015).mean() < 0.03, "hardly a trace of the first holds"
    assert mesh.area > 0.6 * SMALL.area, "more than what one side shows"
