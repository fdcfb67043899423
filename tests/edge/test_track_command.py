"""Tests of ``enliven track``: depth becomes a recording of tracked bodies, and refused input changes
nothing.
"""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import typer
from PIL import Image
from typer.testing import CliRunner

from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.motion_clips.take_files import read_take
from enliven.recording import Recorder, Recording
from enliven_edge.commands.track import track, track_frames
from enliven_edge.doctor import find_shipped_recording
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.tracker import Tracker

FRAMES = 45

app = typer.Typer(pretty_exceptions_enable=False)
app.command()(track)


def run(*words) -> str:
    result = CliRunner().invoke(app, [str(word) for word in words])
    if isinstance(result.exception, InputError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture
def depth(tmp_path):
    with Recorder(tmp_path / "depth.mcap") as recorder:
        for frame in itertools.islice(Recording(find_shipped_recording()).frames(), FRAMES):
            recorder.write_frame(frame)
    return tmp_path / "depth.mcap"


@pytest.mark.slow
def test_depth_becomes_a_take(depth, tmp_path):
    take = tmp_path / "bodies.mcap"
    assert f"{FRAMES} frames of bodies, 1 person" in run(depth, "-o", take)
    clip, _ = read_take(take)
    assert clip.duration > 1.0
    tracker, expected_frames = Tracker(), []
    for frame in Recording(depth).frames():
        expected_frames.append([body.joints for body in tracker.track(frame)])
    written = [[body.joints for body in frame.bodies] for frame in Recording(take).frames()]
    assert [len(each) for each in written] == [len(each) for each in expected_frames]
    for actual, expected in zip(written, expected_frames, strict=True):
        np.testing.assert_allclose(actual, expected, atol=1e-5)  # recordings store float32 metres
    before = take.read_bytes()
    with pytest.raises(InputError, match="exists already"):
        run(depth, "-o", take)
    with pytest.raises(InputError, match="the recording has no depth images"):
        run(take, "-o", tmp_path / "again.mcap")
    assert take.read_bytes() == before and not list(tmp_path.glob("*.part"))


@pytest.mark.slow
def test_person_at_the_start_is_found_in_the_first_image(depth, tmp_path):
    run(depth, "-o", tmp_path / "bodies.mcap")
    assert all(len(frame.bodies) == 1 for frame in Recording(tmp_path / "bodies.mcap").frames())


@pytest.fixture
def image(depth, tmp_path):
    """Returns the shipped recording's first image as a 16-bit PNG, its frame, and the option for its lens."""
    frame = next(iter(Recording(depth).frames()))
    Image.fromarray(frame.depth).save(tmp_path / "image.png")
    camera = frame.intrinsics
    return tmp_path / "image.png", frame, f"{camera.fx},{camera.fy},{camera.cx},{camera.cy}"


def test_single_image_gives_a_take(image, tmp_path):
    """The joints equal those of the same image in a recording, except for the sensor pose in the
    recording.
    """
    path, frame, lens = image
    take = tmp_path / "bodies.mcap"
    output = run(path, "-o", take, "--lens", lens)
    assert "1 frames of bodies, 1 person" in output
    assert f"fx {frame.intrinsics.fx:.1f}" in output, "the camera is said"
    (written,) = Recording(take).frames()
    (body,) = written.bodies
    (expected,) = track_frames([replace(frame, world_from_camera=None)], TrackerSettings())
    np.testing.assert_allclose(body.joints, expected.bodies[0].joints, atol=1e-5)
    clip, _ = read_take(take)
    assert 0.0 < clip.duration < 0.1, "one pose, held"


def test_image_without_a_known_camera_asks_for_a_lens(image, tmp_path):
    Image.fromarray(image[1].depth[:200]).save(image[0])
    with pytest.raises(InputError, match="no file describes its camera") as caught:
        run(image[0], "-o", tmp_path / "bodies.mcap")
    assert "--lens FX,FY,CX,CY" in caught.value.remedy
    with pytest.raises(InputError, match="is not four numbers"):
        run(image[0], "-o", tmp_path / "bodies.mcap", "--lens", "525,525")


@pytest.mark.parametrize(
    ("name", "mode", "message"),
    [("colour.png", "RGB", "a PNG image in colour"), ("colour.jpg", "RGB", "a JPEG image in colour"),
     ("grey.png", "L", "a PNG image with 256 greys")],
)  # fmt: skip
def test_image_without_depth_is_refused_with_its_type(name, mode, message, tmp_path):
    Image.new(mode, (64, 48)).save(tmp_path / name)
    with pytest.raises(InputError, match=message) as caught:
        run(tmp_path / name, "-o", tmp_path / "bodies.mcap")
    assert caught.value.where == str(tmp_path / name)
    assert "16-bit channel, in millimetres" in caught.value.remedy


def test_cut_off_image_and_foreign_file_are_refused(image, tmp_path):
    cut = tmp_path / "cut.png"
    cut.write_bytes(image[0].read_bytes()[:4000])
    with pytest.raises(InputError, match="damaged"):
        run(cut, "-o", tmp_path / "bodies.mcap", "--lens", image[2])
    text = tmp_path / "text.png"
    text.write_text("no image")
    with pytest.raises(InputError, match="no reader recognises"):
        run(text, "-o", tmp_path / "bodies.mcap")
    assert not list(tmp_path.glob("bodies*"))


def test_an_image_that_cannot_be_used_is_left_out(depth):
    frames = list(itertools.islice(Recording(depth).frames(), 3))
    frames.insert(2, frames[0])  # out of order
    frames.insert(1, BodyFrame([], 1, "other"))
    assert [frame.time_ns for frame in track_frames(frames, TrackerSettings())] == [
        frames[0].time_ns,
        frames[2].time_ns,
        frames[4].time_ns,
    ]
