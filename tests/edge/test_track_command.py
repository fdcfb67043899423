"""``enliven track``: depth becomes a take, as the tracker sees it; what is refused changes nothing."""

import itertools

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.recording import Recorder, Recording
from enliven.takes import read_take
from enliven_edge.commands.track import track, tracked
from enliven_edge.doctor import shipped_recording
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
        for frame in itertools.islice(Recording(shipped_recording()).frames(), FRAMES):
            recorder.write_frame(frame)
    return tmp_path / "depth.mcap"


def test_depth_becomes_a_take(depth, tmp_path):
    made = tmp_path / "bodies.mcap"
    assert f"{FRAMES} frames of bodies, 1 person" in run(depth, "-o", made)
    clip, _ = read_take(made)
    assert clip.duration > 1.0
    tracker, found = Tracker(), []
    for frame in Recording(depth).frames():
        found.append([body.joints for body in tracker.track(frame)])
    written = [[body.joints for body in frame.bodies] for frame in Recording(made).frames()]
    assert [len(each) for each in written] == [len(each) for each in found]
    for one, other in zip(written, found, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-5)  # recordings keep float32 of metres
    before = made.read_bytes()
    with pytest.raises(InputError, match="exists already"):
        run(depth, "-o", made)
    with pytest.raises(InputError, match="no depth images in it"):
        run(made, "-o", tmp_path / "again.mcap")
    assert made.read_bytes() == before and not list(tmp_path.glob("*.part"))


def test_an_image_that_cannot_be_used_is_left_out(depth):
    frames = list(itertools.islice(Recording(depth).frames(), 3))
    frames.insert(2, frames[0])  # out of order
    frames.insert(1, BodyFrame([], 1, "other"))
    assert [frame.time_ns for frame in tracked(frames, TrackerSettings())] == [
        frames[0].time_ns,
        frames[2].time_ns,
        frames[4].time_ns,
    ]
