"""Tests that ``enliven scan`` crops by a box or by a scan of the empty place, and extends an earlier scan."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from box_scans import NOTHING, THING, recorded, run

from enliven.errors import InputError
from enliven.formats.project.file import read_project
from enliven.meshes import load_mesh
from enliven.recording import Recording
from enliven_synthesis.sensor.handheld import STUDIO
from enliven_synthesis.sensor.scene import Box

ROOM = (
    *STUDIO,
    Box((0.75, 0.0, -0.3), (0.95, 0.3, 0.1)),
    Box((-0.95, 0.0, 0.2), (-0.7, 0.25, 0.5)),
    Box((-0.4, 0.0, -1.0), (-0.1, 0.4, -0.8)),
    Box((0.35, 0.0, -0.75), (0.75, 0.45, -0.35)),
)
"""The furniture constrains the camera's pose, which a bare floor alone would not."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Records a room with the object, and the room without it from a part of the path."""
    folder = tmp_path_factory.mktemp("cutting")
    recorded(folder / "with.mcap", room=ROOM)
    recorded(folder / "empty.mcap", NOTHING, 20, 160, room=ROOM)
    return folder


def bounds(path):
    return load_mesh(path).mesh.bounds


@pytest.mark.slow
def test_box_option_equals_the_whole_scan_inside_it(folder, tmp_path):
    whole_path = tmp_path / "whole.ply"
    run("--recording", folder / "with.mcap", "-o", whole_path, "--voxel", 16, "--whole", "--triangles", 0)
    mesh = load_mesh(whole_path).mesh
    # The object is the only surface near the origin that is above the floor.
    high = mesh.vertices[(mesh.vertices[:, 1] > 0.05) & (np.abs(mesh.vertices[:, [0, 2]]) < 0.33).all(1)]
    low, top = high.min(0) - 0.03, high.max(0) + 0.03
    assert top[1] == pytest.approx(0.53, abs=0.03) and np.abs(low[[0, 2]] + top[[0, 2]]).max() < 0.2
    target = tmp_path / "box.glb"
    corners = ",".join(f"{x:.3f}" for x in (low[0], 0.0, low[2], *top))
    output = run("--recording", folder / "with.mcap", "-o", target, "--voxel", 16, f"--box={corners}")
    assert "In the box: 1 part" in output and "square metres" in output
    size = bounds(target)[1] - bounds(target)[0]
    np.testing.assert_allclose(
        size, [high[:, 0].max() - high[:, 0].min(), 0.5, np.ptp(high[:, 2])], atol=0.03
    )
    # This writes the lower half of the kept scan as a project.
    half = tmp_path / "half.enliven"
    corners = ",".join(f"{x:.3f}" for x in (low[0], 0.0, low[2], top[0], 0.25, top[2]))
    kept_recording = tmp_path / "box.scan.mcap"
    run("--recording", kept_recording, "-o", half, "--voxel", 16, f"--box={corners}", "--no-keep")
    (character,) = read_project(half).characters.values()
    assert np.ptp(character.mesh.vertices[:, 1]) == pytest.approx(0.25, abs=0.02)
    assert not (tmp_path / "half.scan.mcap").exists()
    with pytest.raises(InputError, match=r"no surface .* The scanned surface extends from"):
        run("--recording", kept_recording, "-o", tmp_path / "far.glb", "--voxel", 16, "--box=5,0,5,6,1,6")


@pytest.mark.parametrize("box", ["1,2,3", "a,b,c,d,e,f", "0,0,0,1,-1,1", "0,0,0,1,nan,1"])
def test_invalid_box_is_refused_before_the_scan(box, tmp_path):
    with pytest.raises(InputError, match="is not a box"):
        run("--recording", tmp_path / "none.mcap", "-o", tmp_path / "made.glb", f"--box={box}")


@pytest.mark.slow
def test_object_added_between_two_scans_is_extracted(folder, tmp_path):
    target = tmp_path / "new.glb"
    output = run(
        "--recording", folder / "with.mcap", "--before", folder / "empty.mcap", "-o", target, "--voxel", 8
    )
    assert "New: 1 part" in output
    mesh = load_mesh(target).mesh
    size = mesh.bounds[1] - mesh.bounds[0]
    assert mesh.bounds[0, 1] == pytest.approx(0.0, abs=1e-6)
    assert size[1] == pytest.approx(0.5, abs=0.02) and 0.3 < size[0] < 0.56 and 0.3 < size[2] < 0.56
    with pytest.raises(InputError, match="no new object was found"):
        empty = folder / "empty.mcap"
        run("--recording", empty, "--before", empty, "-o", tmp_path / "no.glb", "--voxel", 16)
    with pytest.raises(InputError, match="--whole and --before"):
        run("--recording", target, "--before", target, "--whole", "-o", tmp_path / "no.glb")


def test_scan_of_another_place_is_refused(folder, tmp_path):
    pillars = tuple(Box((x, 0.0, 0.3), (x + 0.12, 2.0, 0.5)) for x in np.arange(-1.5, 1.5, 0.3))
    other = recorded(tmp_path / "other.mcap", NOTHING, 0, 40, room=pillars)
    with pytest.raises(InputError, match="no part of the earlier scan was seen again"):
        run("--recording", folder / "with.mcap", "--before", other, "-o", tmp_path / "no.glb", "--voxel", 16)


@pytest.mark.slow
def test_scan_of_a_bare_floor_is_refused(folder, tmp_path):
    """A bare floor does not constrain the camera, so it must not count as an earlier scan of the place."""
    bare = recorded(tmp_path / "bare.mcap", NOTHING, 0, 60, room=(Box((-9, -0.2, -9), (9, 0, 9)),))
    with pytest.raises(InputError, match=r"little more than one blank surface.* Keep other objects"):
        run("--recording", folder / "with.mcap", "--before", bare, "-o", tmp_path / "no.glb", "--voxel", 16)


@pytest.mark.slow
def test_added_scan_completes_the_earlier_one(tmp_path):
    front = recorded(tmp_path / "front.mcap", last=70)
    back = recorded(tmp_path / "back.mcap", first=50)
    target = tmp_path / "box.glb"
    run("--recording", front, "-o", target, "--voxel", 8)
    first = load_mesh(target).mesh
    assert len(list(Recording(tmp_path / "box.scan.mcap").frames())) == 18
    run("--recording", back, "--add", target, "-o", target, "--voxel", 8)
    both = load_mesh(target).mesh
    assert both.area > 1.25 * first.area, "its back is there now"
    size = both.bounds[1] - both.bounds[0]
    assert size[1] == pytest.approx(0.5, abs=0.02) and max(size[0], size[2]) < 0.56, "and nothing twice"
    full = THING.area - 0.4 * 0.3
    assert both.area > 0.85 * full
    assert len(list(Recording(tmp_path / "box.scan.mcap").frames())) > 18 + 25
    (tmp_path / "box.scan.mcap").unlink()
    before = target.read_bytes()
    with pytest.raises(
        InputError, match=r"the images of this scan were not saved: box\.scan\.mcap is missing"
    ):
        run("--recording", back, "--add", target, "-o", target)
    assert target.read_bytes() == before
    with pytest.raises(InputError, match="cannot be used together"):
        run("--recording", back, "--add", target, "--before", front, "-o", tmp_path / "no.glb")
