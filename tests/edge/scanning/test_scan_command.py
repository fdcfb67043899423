"""Tests of ``enliven scan``: a hand-held camera's recording becomes a mesh, and bad input gives an error."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from enliven.errors import InputError
from enliven.formats.project.file import read_project
from enliven.frames import BodyFrame
from enliven.meshes import Mesh, load_mesh
from enliven.recording import Recorder
from enliven.scanning import Alignment, ScanState, ScanStep
from enliven_edge.scanning.contact_sheet import draw_contact_sheet
from enliven_edge.scanning.scan_log import ScanLog

sys.path.insert(0, str(Path(__file__).parent))
from box_scans import THING, recorded, run


@pytest.fixture(scope="module")
def carried(tmp_path_factory):
    """Returns a recording of a camera that was carried around a box."""
    return recorded(tmp_path_factory.mktemp("scan") / "carried.mcap", step=2, width=320, colour=True)


@pytest.mark.slow
def test_a_box_becomes_a_mesh_on_the_floor_with_a_sheet(carried, tmp_path):
    target, sheet = tmp_path / "box.glb", tmp_path / "box.png"
    output = run("--recording", carried, "-o", target, "--sheet", sheet, "--voxel", 8)
    assert "90 frames" in output and "triangles" in output
    mesh = load_mesh(target).mesh
    size = mesh.bounds[1] - mesh.bounds[0]
    assert mesh.bounds[0, 1] == pytest.approx(0.0, abs=1e-6)
    # The first camera defines the heading, so the box's extent is between its side and its diagonal.
    assert size[1] == pytest.approx(0.5, abs=0.02) and 0.3 < size[0] < 0.56 and 0.3 < size[2] < 0.56
    assert mesh.colours is not None and np.abs(np.median(mesh.colours, axis=0) - 90).max() < 12
    picture = np.asarray(Image.open(sheet))
    assert picture.shape == (720, 1080, 3) and (picture != picture[0, 0]).any(-1).mean() > 0.05


@pytest.mark.slow
def test_budget_is_kept_and_reported_and_a_project_opens(carried, tmp_path):
    target = tmp_path / "box.enliven"
    words = ["--recording", carried, "-o", target, "--voxel", 12, "--seconds", 2]
    output = run(*words, "--triangles", 900)
    assert re.search(r"(8\d\d|900) triangles \(at most \d+\.\d mm from the full scan\)", output)
    (character,) = read_project(target).characters.values()
    assert character.id == "box" and len(character.mesh.faces) <= 900 and character.mesh.colours is not None
    full = run(*words, "--triangles", 0, "--overwrite")
    assert "within" not in full
    (character,) = read_project(target).characters.values()
    assert len(character.mesh.faces) > 2000


@pytest.mark.slow
def test_all_that_was_scanned_is_level_on_the_floor(carried, tmp_path):
    target = tmp_path / "room.ply"
    run("--recording", carried, "-o", target, "--voxel", 16, "--seconds", 1, "--whole", "--triangles", 0)
    mesh = load_mesh(target).mesh
    # The camera looked down by 30 degrees, and its first image states no pose.
    floor = (mesh.face_normals()[:, 1] > 0.9) & (np.abs(mesh.vertices[mesh.faces[:, 0], 1]) < 0.02)
    areas = np.linalg.norm(mesh.face_vectors(), axis=1)
    assert areas[floor].sum() > 0.75 * areas.sum()
    assert abs(np.median(mesh.vertices[mesh.faces[floor, 0], 1])) < 0.004


def test_invalid_scan_arguments_are_refused(carried, tmp_path):
    target = tmp_path / "made.glb"
    with pytest.raises(InputError, match="a scan needs either a recording or a sensor"):
        run("-o", target)
    with pytest.raises(InputError, match=r"files with the extension"):
        run("--recording", carried, "-o", tmp_path / "made.doc")
    target.write_bytes(b"kept")
    with pytest.raises(InputError, match="exists already"):
        run("--recording", carried, "-o", target)
    assert target.read_bytes() == b"kept"
    with Recorder(tmp_path / "bodies.mcap") as recorder:
        recorder.write_frame(BodyFrame([], 0, "none"))
    with pytest.raises(InputError, match="no depth images"):
        run("--recording", tmp_path / "bodies.mcap", "-o", tmp_path / "other.glb")


def step(state, place=0.0, room=True):
    pose = np.eye(4)
    pose[0, 3] = place
    return ScanStep(state, pose, Alignment(pose, 1.0, 1.0, 0.0, np.eye(6)), room)


def test_scan_log_measures_the_path_and_gives_advice():
    scan_log = ScanLog()
    for n in range(10):
        scan_log.add(step(ScanState.SCANNING, 0.02 * n), n * 33_000_000)
    assert scan_log.path_length_m == pytest.approx(0.18) and not scan_log.advice()
    for n in range(10):
        scan_log.add(step(ScanState.LOST), (10 + n) * 33_000_000)
    scan_log.add(step(ScanState.SCANNING, 3.0, room=False), 900_000_000)
    # The gap between losing and finding the camera adds no path length.
    assert scan_log.path_length_m == pytest.approx(0.18)
    advice = " ".join(scan_log.advice())
    assert "10 of 21 frames" in advice and "memory" in advice and "1 m/s" not in advice
    quick = ScanLog()
    for n in range(5):
        quick.add(step(ScanState.SCANNING, 0.1 * n), n * 33_000_000)
    assert "1 m/s" in " ".join(quick.advice())
    with pytest.raises(InputError, match="no frame shows enough depth"):
        ScanLog().raise_scan_error("here")


def test_the_sheet_shows_the_colours_and_where_a_mesh_is_open():
    mesh = Mesh(THING.vertices, THING.faces, colours=np.tile(np.array([[40, 200, 60]], np.uint8), (8, 1)))
    sheet = draw_contact_sheet(mesh).astype(int)
    green = (sheet[..., 1] > sheet[..., 0] + 30) & (sheet[..., 1] > sheet[..., 2] + 30)
    red = (sheet[..., 0] > 100) & (sheet[..., 1] < 60)
    assert green.mean() > 0.45 and not red.any()
    opened = draw_contact_sheet(mesh.with_faces(np.arange(2, 12))).astype(int)
    assert ((opened[..., 0] > 100) & (opened[..., 1] < 60)).any()
