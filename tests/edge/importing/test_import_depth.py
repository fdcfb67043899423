"""Tests of the depth readers, each on small images that the test writes in the reader's layout."""

import json

import numpy as np
import pytest
from PIL import Image

from enliven.camera import pixel_rays, project, unproject_depth
from enliven.errors import InputError
from enliven_edge.importing.base import ImportOptions, natural_order
from enliven_edge.importing.mirror import mirror_frames
from enliven_edge.importing.registry import find_files, find_reader, readers

XML = """<?xml version="1.0"?>
<opencv_storage>
<intrinsic type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>f</dt>
  <data>
    52.5 0. 3.2e+001 0. 52.6 2.4e+001 0. 0. 1.</data></intrinsic>
<t type_id="opencv-matrix"><rows>3</rows><cols>1</cols><dt>f</dt><data> 1. 2. 3.</data></t>
</opencv_storage>
"""


def depth_image(seed: int, height: int = 48, width: int = 64) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 5000, (height, width), np.uint16)


def save(path, array):
    Image.fromarray(array).save(path)


def read(folder, **options):
    paths = find_files([str(folder)])
    reader = find_reader(paths)
    return reader.name, list(reader.read(paths, ImportOptions(**options)))


def read_with(name, folder, **options):
    """Returns (frames, notes) of the reader with a name."""
    notes: list[str] = []
    paths = find_files([str(folder)])
    frames = list(find_reader(paths, name).read(paths, ImportOptions(**options, note=notes.append)))
    return frames, notes


def test_opencv_depth_is_read(tmp_path):
    for i in (0, 1, 2, 10):
        save(tmp_path / f"{i}_depth.png", depth_image(i))
        (tmp_path / f"{i}_camera.xml").write_text(XML)
    save(tmp_path / "10.jpg", np.full((48, 64, 3), 200, np.uint8))
    save(tmp_path / "10_mask.jpg", np.zeros((48, 64), np.uint8))
    (tmp_path / "SOURCE.txt").write_text("words")
    name, frames = read(tmp_path, fps=20)
    assert name == "opencv-depth"
    assert [frame.time_ns for frame in frames] == [0, 50_000_000, 100_000_000, 150_000_000]
    for i, frame in zip((0, 1, 2, 10), frames, strict=True):
        assert np.array_equal(frame.depth, depth_image(i))
    camera = frames[0].intrinsics
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (52.5, 52.6, 32.0, 24.0)
    assert [frame.colour is not None for frame in frames] == [False, False, False, True]
    assert abs(int(frames[3].colour[5, 5, 1]) - 200) < 3


def test_raw_kinect1_image_is_read(tmp_path):
    for i in range(2):
        depth_image(i, 480, 640).astype("<u2").tofile(tmp_path / f"depth-{i}.u16")
    name, frames = read(tmp_path)
    assert name == "raw-kinect1"
    assert np.array_equal(frames[1].depth, depth_image(1, 480, 640))
    assert frames[1].intrinsics.fx == 525
    assert frames[1].time_ns == 33_333_333


def test_random_bytes_of_the_right_length_are_no_kinect_image(tmp_path):
    np.random.default_rng(0).integers(0, 65536, (480, 640), np.uint16).tofile(tmp_path / "noise.bin")
    with pytest.raises(InputError, match="no reader recognises"):
        read(tmp_path)


def test_realsense_takes_the_device_of_the_file_name(tmp_path):
    sizes = [
        {"1280x720": [960.0, 0, 630.5, 0, 961.0, 350.5, 0, 0, 1]},
        {"640x480": [640.0, 0, 320, 0, 640, 240, 0, 0, 1]},
    ]
    entry = {"Device": "M11", "Type": "Intel RealSense D415", "Serial": "42", "Depth Intrinsics": sizes}
    (tmp_path / "device_repository.json").write_text(json.dumps([{"Device": "M7"}, entry]))
    save(tmp_path / "0_M11_depth_0.png", depth_image(0, 360, 640))
    name, frames = read(tmp_path)
    camera = frames[0].intrinsics
    assert name == "realsense"
    assert frames[0].sensor == "realsense-d415-42"
    assert (camera.fx, camera.fy) == (480.0, 480.5)
    assert (camera.cx, camera.cy) == (315.0, 175.0)
    save(tmp_path / "1_M99_depth_0.png", depth_image(0, 360, 640))
    with pytest.raises(InputError, match=r"M99 is not in the list.*Known devices: M11, M7"):
        read(tmp_path)


def test_a_size_without_calibration_is_refused(tmp_path):
    (tmp_path / "device_repository.json").write_text('[{"Device": "A", "Depth Intrinsics": []}]')
    save(tmp_path / "0_A_depth_0.png", depth_image(0))
    with pytest.raises(InputError, match="no depth calibration for 64x48"):
        read(tmp_path)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b'["A"]', "list of devices is damaged"),
        (b'[{"Device": "A", "Depth Intrinsics": [[1]]}]', "list of devices is damaged"),
        (b'[{"Device": "A", "Depth Intrinsics": [{"64x48": 1}]}]', "list of devices is damaged"),
        (b'[{"Device": "\xff"}]', "list of devices is damaged"),
        (
            b'[{"Device": "A", "Depth Intrinsics": [{"wide": [1, 0, 0, 0, 1, 0, 0, 0, 1]}]}]',
            "Known sizes: wide",
        ),
        (b'[{"Device": "A", "Depth Intrinsics": [{"0x0": [1, 0, 0, 0, 1, 0, 0, 0, 1]}]}]', "no depth calib"),
    ],
)
def test_a_damaged_list_of_devices_is_refused(tmp_path, content, expected):
    (tmp_path / "device_repository.json").write_bytes(content)
    save(tmp_path / "0_A_depth_0.png", depth_image(0))
    with pytest.raises(InputError, match=expected):
        read(tmp_path)


def test_posed_depth_turns_the_world_upright(tmp_path):
    pose = np.eye(4)
    pose[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    pose[:3, 3] = (1, 2, 3)
    save(tmp_path / "frame-000.depth.png", depth_image(0))
    np.savetxt(tmp_path / "frame-000.pose.txt", pose)
    np.savetxt(tmp_path / "camera-intrinsics.txt", [[585, 0, 32], [0, 586, 24], [0, 0, 1]])
    name, frames = read(tmp_path)
    assert name == "posed-depth"
    assert np.allclose(frames[0].world_from_camera, np.diag([1, -1, -1, 1]) @ pose)
    assert np.linalg.det(frames[0].world_from_camera[:3, :3]) == pytest.approx(1)
    assert (frames[0].intrinsics.fx, frames[0].intrinsics.cy) == (585, 24)
    np.savetxt(tmp_path / "frame-000.pose.txt", 2 * pose)
    with pytest.raises(InputError, match="not a rotation"):
        read(tmp_path)
    (tmp_path / "frame-000.pose.txt").write_text("1 2 three")
    with pytest.raises(InputError, match="text that is not a number"):
        read(tmp_path)


def test_plain_depth_of_the_usual_size_is_read(tmp_path):
    save(tmp_path / "a9.png", depth_image(9, 240, 320))
    save(tmp_path / "a10.png", depth_image(10, 240, 320))
    name, frames = read(tmp_path)
    assert name == "plain-depth"
    assert np.array_equal(frames[0].depth, depth_image(9, 240, 320))
    assert frames[0].intrinsics.fx == 262.5
    save(tmp_path / "a11.png", depth_image(1, 50, 50))
    with pytest.raises(InputError, match="50x50 pixels, and no file describes its camera"):
        read(tmp_path)


def test_a_damaged_image_is_named(tmp_path):
    for i in range(2):
        save(tmp_path / f"{i}_depth.png", depth_image(i))
        (tmp_path / f"{i}_camera.xml").write_text(XML)
    whole = (tmp_path / "1_depth.png").read_bytes()
    (tmp_path / "1_depth.png").write_bytes(whole[:200])
    with pytest.raises(InputError, match=r"1_depth.png: the image is damaged"):
        read(tmp_path)
    for i in range(2):
        save(tmp_path / f"{i}_depth.png", np.zeros((48, 64), np.uint8))
    with pytest.raises(InputError, match=r"0_depth.png: .*256 greys, not an image with one 16-bit channel"):
        read_with("opencv-depth", tmp_path)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<opencv_storage>", "camera file is damaged"),
        ("<opencv_storage></opencv_storage>", "has 0 numbers"),
        (XML.replace("52.5", "0."), "focal length"),
        (XML.replace("52.5", "nan"), "focal length"),
    ],
)
def test_a_damaged_camera_file_is_refused(tmp_path, text, expected):
    save(tmp_path / "0_depth.png", depth_image(0))
    (tmp_path / "0_camera.xml").write_text(text)
    with pytest.raises(InputError, match=expected):
        read(tmp_path)


def test_mirroring_keeps_every_point_in_its_place_across(tmp_path):
    save(tmp_path / "0_depth.png", depth_image(0))
    (tmp_path / "0_camera.xml").write_text(XML)
    (frame,) = read(tmp_path)[1]
    (mirror,) = mirror_frames(iter([frame]))
    points = unproject_depth(frame.depth, pixel_rays(frame.intrinsics))
    reflected = unproject_depth(mirror.depth, pixel_rays(mirror.intrinsics))[:, ::-1] * [-1, 1, 1]
    assert np.allclose(points, reflected)
    (again,) = mirror_frames(iter([mirror]))
    assert again.intrinsics == frame.intrinsics
    seen = frame.depth > 0
    assert np.allclose(project(points[seen], frame.intrinsics)[:, 0], np.nonzero(seen)[1])


def test_files_are_sorted_by_number(tmp_path):
    names = ["a2_x10.png", "a10_x1.png", "a2_x9.png"]
    ordered = sorted((tmp_path / name for name in names), key=natural_order)
    assert [path.name for path in ordered] == ["a2_x9.png", "a2_x10.png", "a10_x1.png"]


def test_files_folders_and_patterns_are_expanded(tmp_path):
    for name in ("a.txt", "b.txt", "c.bin"):
        (tmp_path / name).write_text("x")
    assert len(find_files([str(tmp_path)])) == 3
    assert len(find_files([str(tmp_path / "*.txt"), str(tmp_path / "a.txt")])) == 2
    (tmp_path / "empty").mkdir()
    for name, expected in (
        ("none", "no such file"),
        ("*.png", "no such file"),
        ("empty", "contains no files"),
    ):
        with pytest.raises(InputError, match=expected):
            find_files([str(tmp_path / name)])


def frames_or_refusal(reader, path):
    try:
        return list(reader.read([path]))
    except InputError as error:
        assert str(path.parent) in error.where
        return None


def test_every_reader_presents_itself_and_survives_any_file(tmp_path):
    contents = [b"", b"\0" * 5000, b"\x89PNG\r\n\x1a\n", b"[", b"1,2,3\n", bytes(range(256)), b"Head;x;y;z\n"]
    paths = [tmp_path / f"{i}_depth.png" for i in range(len(contents))]
    for path, content in zip(paths, contents, strict=True):
        path.write_bytes(content)
    for name, reader in readers().items():
        assert reader.name == name
        assert reader.description
        for path in [*paths, tmp_path / "missing.csv", tmp_path]:
            assert reader.can_read([path]) in (True, False)
            assert frames_or_refusal(reader, path) in ([], None)
        assert not reader.can_read([])


def test_an_unknown_reader_names_the_nearest(tmp_path):
    with pytest.raises(InputError, match="Did you mean kinect-gait"):
        find_reader([tmp_path], "kinect-gate")


def test_other_packages_add_readers(monkeypatch, tmp_path):
    class Mine:
        name, description, note = "mine", "a layout", ""

        def can_read(self, paths):
            return paths[0].suffix == ".mine"

        def read(self, paths, options):
            yield from ()

    class Entry:
        name = "mine"

        def load(self):
            return Mine

    class Broken(Entry):
        name = "broken"

        def load(self):
            raise ImportError("no such module")

    module = "enliven_edge.importing.registry.entry_points"
    monkeypatch.setattr(module, lambda group: [Broken(), Entry()])
    with pytest.warns(UserWarning, match="'broken' cannot be loaded"):
        assert find_reader([tmp_path / "a.mine"]).name == "mine"


def spoil(path, how):
    """Replaces a depth image by an image without depth."""
    if how == "empty":
        path.write_bytes(b"")
    elif how == "colour":
        save(path, np.zeros((240, 320, 3), np.uint8))
    elif how == "8 bits":
        save(path, np.zeros((240, 320), np.uint8))
    else:
        path.write_text("a web page: not found")


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("empty", "the file is empty"),
        ("colour", "a PNG image in colour"),
        ("8 bits", "256 greys"),
        ("a web page", "not a PNG"),
    ],
)
@pytest.mark.parametrize("at", [0, 2, 4])
def test_an_image_without_depth_is_reported_and_leaves_a_gap(tmp_path, how, words, at):
    for i in range(5):
        save(tmp_path / f"depth_{i}.png", depth_image(i, 240, 320))
        save(tmp_path / f"colour_{i}.png", np.zeros((240, 320, 3), np.uint8))
    spoil(tmp_path / f"depth_{at}.png", how)
    frames, notes = read_with(None, tmp_path, fps=10)
    readable = [i for i in range(5) if i != at]
    assert [frame.time_ns for frame in frames] == [i * 10**8 for i in readable]
    for i, frame in zip(readable, frames, strict=True):
        assert np.array_equal(frame.depth, depth_image(i, 240, 320))
    (warning,) = [note for note in notes if "skipped" in note]
    assert f"depth_{at}.png" in warning and words in warning


def test_many_images_without_depth_are_counted(tmp_path):
    for i in range(20):
        save(tmp_path / f"{i}.png", depth_image(i, 240, 320))
        if i % 2:
            spoil(tmp_path / f"{i}.png", "empty")
    frames, notes = read_with(None, tmp_path)
    assert len(frames) == 10
    assert len([note for note in notes if "is skipped" in note]) == 5
    assert "5 more images are skipped; the last is 19.png" in notes


def wall(units, metres=2.0, height=240, width=320):
    return np.full((height, width), round(units * metres), np.uint16)


@pytest.mark.parametrize("units", [1000.0, 5000.0, 10_000.0, 4000.0])
def test_a_stated_unit_gives_millimetres(tmp_path, units):
    save(tmp_path / "a_0.png", wall(units))
    (frame,), notes = read_with(None, tmp_path, units_per_metre=units)
    assert (frame.depth == 2000).all()
    assert notes == []


def test_the_assumed_unit_is_noted_and_doubted_if_it_is_far(tmp_path):
    save(tmp_path / "a_0.png", wall(1000))
    _, notes = read_with(None, tmp_path)
    assert notes == ["depth values are read as millimetres; --units-per-metre sets another unit"]
    save(tmp_path / "a_0.png", wall(5000))
    _, notes = read_with(None, tmp_path)
    assert "beyond 10.0 m" in notes[1] and "5000" in notes[1]


def test_a_d405_is_known_by_name(tmp_path):
    folder = tmp_path / "D405_session"
    folder.mkdir()
    save(folder / "depth_0.png", wall(10_000, 0.3))
    (frame,), notes = read_with(None, folder)
    assert (frame.depth == 300).all() and "RealSense D405" in notes[0]
    matrix = {"320x240": [300.0, 0, 160, 0, 300, 120, 0, 0, 1]}
    entry = {"Device": "A", "Type": "Intel RealSense D405", "Serial": "1", "Depth Intrinsics": [matrix]}
    devices = tmp_path / "devices"
    devices.mkdir()
    (devices / "device_repository.json").write_text(json.dumps([entry]))
    save(devices / "0_A_depth_0.png", wall(10_000, 0.3))
    (frame,), _ = read_with(None, devices)
    assert (frame.depth == 300).all()


def tum(folder, count=4):
    """Writes a sequence of an approaching wall in the layout of the TUM benchmark."""
    (folder / "depth").mkdir(parents=True)
    (folder / "rgb").mkdir()
    lists = {name: ["# a comment", "# timestamp filename"] for name in ("depth", "rgb")}
    poses = ["# timestamp tx ty tz qx qy qz qw"]
    for k in range(count):
        seconds = f"1305031453.{374112 + 33_333 * k:06d}"
        save(folder / "depth" / f"{seconds}.png", wall(5000, 2.0 - 0.1 * k, 480, 640))
        save(folder / "rgb" / f"{seconds[:-3]}999.png", np.full((480, 640, 3), 50 * k, np.uint8))
        lists["depth"].append(f"{seconds} depth/{seconds}.png")
        lists["rgb"].append(f"{seconds[:-3]}999 rgb/{seconds[:-3]}999.png")
        poses.append(f"{seconds} {k} 2 3 0 0 0 1")
    for name, lines in lists.items():
        (folder / f"{name}.txt").write_text("\n".join(lines) + "\n")
    (folder / "groundtruth.txt").write_text("\n".join(poses) + "\n")
    (folder / "accelerometer.txt").write_text("# nothing\n")


@pytest.mark.parametrize("part", ["", "depth"])
def test_a_tum_sequence_has_its_times_unit_colour_and_poses(tmp_path, part):
    tum(tmp_path / "rgbd_dataset")
    name, frames = read(tmp_path / "rgbd_dataset" / part)
    assert name == "tum-depth"
    assert [frame.time_ns for frame in frames] == [1305031453374112000 + 33_333_000 * k for k in range(4)]
    assert [int(frame.depth[0, 0]) for frame in frames] == [2000, 1900, 1800, 1700]
    assert [int(frame.colour[0, 0, 0]) for frame in frames] == [0, 50, 100, 150]
    assert frames[0].intrinsics.fx == 525.0
    np.testing.assert_allclose(frames[3].world_from_camera[:3, 3], [3, 3, -2])
    assert np.linalg.det(frames[0].world_from_camera[:3, :3]) == pytest.approx(1)


def test_a_tum_sequence_without_lists_or_with_a_gap(tmp_path):
    tum(tmp_path)
    for name in ("depth.txt", "rgb.txt", "groundtruth.txt", "accelerometer.txt"):
        (tmp_path / name).unlink()
    second = sorted((tmp_path / "depth").iterdir())[1]
    spoil(second, "empty")
    frames, notes = read_with(None, tmp_path)
    assert [frame.time_ns % 10**9 for frame in frames] == [374112000, 440778000, 474111000]
    assert any("TUM" in note for note in notes) and any(second.name in note for note in notes)
    assert frames[0].colour is None and frames[0].world_from_camera is None


def test_a_tum_list_is_checked(tmp_path):
    tum(tmp_path)
    (tmp_path / "depth.txt").write_text("1305031453.374112 ../secret.png\n")
    with pytest.raises(InputError, match="outside the folder of the list"):
        read(tmp_path)
    tum(tmp_path / "b")
    with (tmp_path / "b" / "groundtruth.txt").open("a") as file:
        file.write("1305031453 1 2\n")
    with pytest.raises(InputError, match="line 6 does not consist of a time"):
        read(tmp_path / "b")


def test_seven_scenes_are_read_as_they_come(tmp_path):
    folder = tmp_path / "chess" / "seq-01"
    folder.mkdir(parents=True)
    (tmp_path / "chess" / "TrainSplit.txt").write_text("sequence1\n")
    depth = wall(1000, 2.0, 480, 640)
    depth[:10] = 65_535
    save(folder / "frame-000000.depth.png", depth)
    save(folder / "frame-000000.color.png", np.full((480, 640, 3), 7, np.uint8))
    np.savetxt(folder / "frame-000000.pose.txt", np.eye(4))
    (frame,), notes = read_with(None, folder)
    assert frame.intrinsics.fx == 585.0 and any("7-Scenes" in note for note in notes)
    assert (frame.depth[:10] == 0).all() and (frame.depth[10:] == 2000).all()
    assert frame.colour is not None and frame.world_from_camera is not None
    with pytest.raises(InputError, match=r"1 separate recordings.*seq-01"):
        find_files([str(tmp_path / "chess")])
