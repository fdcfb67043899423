"""Tests of ``enliven scan`` on bad input: the reason is reported, and usable data is kept."""

import errno
import os
import re
import signal
import sys
from dataclasses import replace
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from box_scans import NOTHING, PATH, recorded, run, take_of, with_depth, write

from enliven.errors import InputError, ResourceError
from enliven.meshes import load_mesh
from enliven_edge.scanning.scan_log import ScanLog
from enliven_synthesis.sensor.handheld import STUDIO, HandheldPath
from enliven_synthesis.sensor.scene import Box


@pytest.fixture(scope="module")
def carried(tmp_path_factory):
    """Records a third of a round about the box, without colour."""
    return recorded(tmp_path_factory.mktemp("bad") / "carried.mcap", last=60)


def test_unmoved_camera_gives_advice(tmp_path):
    frame = take_of().frame(0)
    still = write((replace(frame, time_ns=n * 33_000_000) for n in range(5)), tmp_path / "still.mcap")
    with pytest.raises(InputError, match=r"the camera moved only 0 cm\. Carry the camera around"):
        run("--recording", still, "-o", tmp_path / "no.glb", "--voxel", 16)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["still.mcap"]


def test_too_fast_camera_gives_advice(tmp_path):
    quick = replace(PATH, seconds=0.8)
    flung = recorded(tmp_path / "flung.mcap", way=quick, last=24, step=3)
    with pytest.raises(
        InputError, match=r"the camera was lost in \d of 8 frames.*half a metre per second at most"
    ):
        run("--recording", flung, "-o", tmp_path / "no.glb", "--voxel", 16)


@pytest.mark.slow
def test_partly_too_fast_scan_keeps_the_rest_and_reports_it(carried, tmp_path):
    """In the second half, every image is from a different position."""
    take, frames = take_of(), []
    for n, index in enumerate([*range(0, 60, 4), *range(61, 180, 17)]):
        frames.append(replace(take.frame(index), time_ns=n * 33_000_000))
    output = run(
        "--recording", write(frames, tmp_path / "part.mcap"), "-o", tmp_path / "part.glb", "--voxel", 16
    )
    assert "frames are not in the mesh, because tracking was lost. Carry the camera more slowly" in output
    assert load_mesh(tmp_path / "part.glb").mesh.bounds[1, 1] == pytest.approx(0.5, abs=0.04)


@pytest.mark.slow
@pytest.mark.parametrize("distance", [1.0, 1.5, 3.0])
def test_blank_wall_is_reported(tmp_path, distance):
    wall = (Box((-9.0, -9.0, -0.4), (9.0, 9.0, 0.0)),)
    way = HandheldPath(target=(0.0, 0.5, 0.0), radius=distance, height=(0.5, 0.8), turns=0.03, seconds=2.0)
    blank = recorded(tmp_path / "wall.mcap", NOTHING, way=way, room=wall)
    with pytest.raises(InputError, match=r"only a blank surface was seen.* Keep corners"):
        run("--recording", blank, "-o", tmp_path / "no.glb", "--voxel", 16, "--reach", 5)


@pytest.mark.slow
def test_mirror_hole_stays_a_hole(tmp_path):
    """A part of the object has no depth from any direction. The rest is scanned."""

    def mirror(depth):
        height, width = depth.shape
        depth[height // 3 : height // 2, width // 3 : width // 2] = 0

    target = tmp_path / "holed.glb"
    holed = recorded(tmp_path / "holed.mcap", last=60, change=lambda frame: with_depth(frame, mirror))
    output = run("--recording", holed, "-o", target, "--voxel", 16)
    assert "from 15 frames" in output and load_mesh(target).mesh.bounds[1, 1] == pytest.approx(0.5, abs=0.04)
    nothing = recorded(
        tmp_path / "dark.mcap", last=12, change=lambda frame: with_depth(frame, lambda d: d.fill(0))
    )
    with pytest.raises(InputError, match=r"no frame shows enough depth.* does not reflect"):
        run("--recording", nothing, "-o", tmp_path / "no.glb")


@pytest.mark.slow
def test_missing_object_is_reported_and_sensor_recording_is_kept(tmp_path):
    # The surfaces for camera tracking are beyond the kept depth range.
    empty = recorded(tmp_path / "empty.mcap", NOTHING, last=60)
    target = tmp_path / "no.glb"
    with pytest.raises(InputError, match=r"no object on the floor.*--whole"):
        run("--recording", empty, "-o", target, "--voxel", 16, "--reach", 1.6)
    assert not (tmp_path / "no.scan.mcap").exists(), "the recording is there anyway"
    sensor = [
        "--sensor",
        "replay",
        "--set",
        f"path={empty}",
        "--set",
        "speed=0",
        "--voxel",
        16,
        "--reach",
        1.6,
    ]
    with pytest.raises(InputError, match=r"The images were saved\. .* --recording .*no\.scan\.mcap"):
        run(*sensor, "-o", target)
    assert not target.exists()
    run("--recording", tmp_path / "no.scan.mcap", "-o", target, "--voxel", 16, "--whole")
    assert len(load_mesh(target).mesh.faces) > 1000


@pytest.mark.slow
def test_centred_object_is_taken_and_the_other_can_be_selected(tmp_path):
    low = Box((-0.85, 0.0, -0.2), (-0.5, 0.3, 0.2))
    both = recorded(tmp_path / "both.mcap", last=60, room=(*STUDIO, low))
    words = ["--recording", both, "--voxel", 8, "--no-keep"]
    output = run(*words, "-o", tmp_path / "first.glb")
    assert re.search(r"2 objects are on the floor \(1: .*, 2: .* cm\)\. Number 1 was kept; --thing", output)
    run(*words, "-o", tmp_path / "second.glb", "--thing", 2)
    tall, short = (load_mesh(tmp_path / f"{name}.glb").mesh.bounds[1, 1] for name in ("first", "second"))
    assert tall == pytest.approx(0.5, abs=0.04) and short == pytest.approx(0.3, abs=0.04)
    with pytest.raises(InputError, match=r"object number 3 does not exist; the camera looked at 2 objects"):
        run(*words, "-o", tmp_path / "third.glb", "--thing", 3)


@pytest.mark.slow
def test_recording_without_colours_gives_a_plain_mesh_and_a_note(carried, tmp_path):
    output = run("--recording", carried, "-o", tmp_path / "plain.glb", "--voxel", 16)
    assert "The camera sent no colours, so the mesh has no colours" in output
    assert load_mesh(tmp_path / "plain.glb").mesh.colours is None


@pytest.mark.slow
def test_a_full_memory_ends_the_scan_and_all_until_then_is_kept(carried, tmp_path):
    target = tmp_path / "part.glb"
    output = run("--recording", carried, "-o", target, "--voxel", 4, "--memory", 30, "--whole")
    assert "The memory for voxels was full, so later images were not added" in output and "--memory" in output
    assert int(re.search(r"from (\d+) frames", output)[1]) < 15, "it does not go on to the end"
    assert len(load_mesh(target).mesh.faces) > 10_000


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C to whole groups of processes")
def test_ctrl_c_saves_the_scan(carried, tmp_path, monkeypatch):
    add = ScanLog.add

    def interrupted(scan_log, step, time_ns):
        add(scan_log, step, time_ns)
        if scan_log.frames == 8:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(ScanLog, "add", interrupted)
    before = signal.getsignal(signal.SIGINT)
    # The camera delivers images for ever.
    camera = ["--sensor", "replay", "--set", f"path={carried}", "--set", "loop=true", "--set", "speed=0"]
    output = run(*camera, "-o", tmp_path / "part.glb", "--voxel", 16)
    assert "from 8 frames" in output and len(load_mesh(tmp_path / "part.glb").mesh.faces) > 100
    assert (tmp_path / "part.scan.mcap").stat().st_size > 10_000
    assert signal.getsignal(signal.SIGINT) is before


def full_disk(monkeypatch, folder, of_all=False):
    """Makes every write into a folder, or every write at all, fail as on a full disk."""

    def no_room(descriptor):
        if of_all or os.readlink(f"/proc/self/fd/{descriptor}").startswith(str(folder)):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", no_room)


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="it asks /proc which file is written")
@pytest.mark.parametrize("ending", ["glb", "enliven"])
def test_full_disk_keeps_the_scan_and_the_old_file(carried, tmp_path, monkeypatch, ending):
    disk, home = tmp_path / "disk", tmp_path / "home"
    disk.mkdir(), home.mkdir()
    target = disk / f"thing.{ending}"
    target.write_bytes(b"before")
    monkeypatch.setenv("HOME", str(home))
    full_disk(monkeypatch, disk)
    with pytest.raises(
        ResourceError, match=r"No space left on device.*so the scan was saved as .*Free some disk space"
    ) as refused:
        run("--recording", carried, "-o", target, "--voxel", 16, "--overwrite", "--no-keep")
    assert refused.value.where == str(target) and target.read_bytes() == b"before"
    saved = home / f"thing.saved.{ending}"
    assert str(saved) in refused.value.what and saved.stat().st_size > 10_000
    assert [path.name for path in disk.iterdir()] == [target.name], "no half of a file is left"
    full_disk(monkeypatch, disk, of_all=True)
    with pytest.raises(ResourceError, match="No space left on device"):
        run("--recording", carried, "-o", target, "--voxel", 16, "--overwrite", "--no-keep")
    assert target.read_bytes() == b"before"
