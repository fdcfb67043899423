"""Recordings of a synthetic camera that is carried around a box, and ``enliven scan`` of them."""

import sys
from dataclasses import replace
from pathlib import Path

import typer
from typer.testing import CliRunner

from enliven.errors import EnlivenError
from enliven.recording import Recorder
from enliven_edge.commands.scan import scan
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.scene import Box

sys.path.insert(0, str(Path(__file__).parents[1] / "synthesis"))
from test_handheld import box_mesh

app = typer.Typer(pretty_exceptions_enable=False)
app.command()(scan)
PATH = HandheldPath(target=(0.0, 0.2, 0.0), radius=1.25, height=(0.8, 1.0), turns=1.0, seconds=6.0)
"""Once around the box in six seconds, at 0.2 m/s."""
THING = box_mesh(Box((-0.2, 0.0, -0.15), (0.2, 0.5, 0.15)))
NOTHING = box_mesh(Box((50.0, 0.0, 50.0), (50.1, 0.1, 50.1)))
"""A mesh that is out of view."""


def run(*words) -> str:
    """Runs the command and returns its output; raises its error."""
    result = CliRunner().invoke(app, [str(word) for word in words])
    if isinstance(result.exception, EnlivenError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def take_of(thing=THING, path=PATH, colour=False, width=240, **given) -> HandheldScan:
    """Returns the recording of the carried camera."""
    return HandheldScan(thing, load_profile("kinect1"), path, width=width, colour=colour, **given)


def write(frames, path: Path) -> Path:
    """Writes frames as a recording."""
    with Recorder(path) as recorder:
        for frame in frames:
            recorder.write_frame(frame)
    return path


def recorded(path: Path, thing=THING, first=0, last=180, step=4, way=PATH, change=None, **given) -> Path:
    """Writes a recording of some images of a path; ``change`` modifies each frame."""
    take = take_of(thing, way, **given)
    frames = (take.frame(index) for index in range(first, min(last, take.frames), step))
    return write((frame if change is None else change(frame) for frame in frames), path)


def with_depth(frame, change):
    """Returns the frame with its depth image changed."""
    depth = frame.depth.copy()
    change(depth)
    return replace(frame, depth=depth)
