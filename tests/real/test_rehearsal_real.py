"""A real recording rehearsed through the cameras' libraries gives the bodies that its replay gives."""

import importlib.util
import os
from pathlib import Path

import numpy as np
import pytest

from enliven.frames import DepthFrame
from enliven.recording import Recorder
from enliven_edge.importing.base import ImportOptions
from enliven_edge.importing.registry import find_files, find_reader
from enliven_edge.sensors.registry import open_sensor
from enliven_edge.tracking.tracker import Tracker

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
TAKE = DATA / "depth" / "uva_cv2_person_turn"
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not TAKE.is_dir(), reason="the real recordings (ENLIVEN_DATA) are not here"),
]
FRAMES = 45
ATTEMPTS = 4
"""A loaded machine may leave out images of a rehearsal, as of a device; then it is tried again."""


@pytest.fixture(scope="module")
def take(tmp_path_factory) -> Path:
    """The recording's first frames, imported as a user would."""
    path = tmp_path_factory.mktemp("rehearsal") / "real.mcap"
    paths = find_files([TAKE])
    with Recorder(path) as recorder:
        for frame, _ in zip(find_reader(paths).read(paths, ImportOptions()), range(FRAMES), strict=False):
            recorder.write_frame(frame)
    return path


def frames_of(name: str, **options) -> list[DepthFrame]:
    frames = []
    with open_sensor(name, **options) as sensor:
        while True:
            try:
                frame = sensor.read(1.0)
            except TimeoutError:
                continue
            if frame is None:
                return frames
            frames.append(frame)


def joints_of(frames: list[DepthFrame]) -> list[np.ndarray]:
    """(bodies, 20, 3) a frame."""
    tracker = Tracker()
    return [np.array([body.joints for body in tracker.track(frame)]) for frame in frames]


@pytest.mark.parametrize(("driver", "library"), [("oak", "depthai"), ("realsense", "pyrealsense2")])
def test_the_bodies_are_the_same_to_the_millimetre(driver, library, take):
    if importlib.util.find_spec(library) is None:
        pytest.skip(f'{library} is not installed: pip install "./edge[{driver}]"')
    recorded = frames_of("replay", path=str(take), speed=0.0)
    for _ in range(ATTEMPTS):
        rehearsed = frames_of(driver, rehearse=str(take))
        if len(rehearsed) == len(recorded):
            break
    else:
        pytest.skip("this machine is too loaded to take in every image at its pace")
    expected, found = joints_of(recorded), joints_of(rehearsed)
    assert max(map(len, expected)) == 1
    for a, b in zip(expected, found, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-3)
