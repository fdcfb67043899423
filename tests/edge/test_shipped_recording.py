"""Tests of the shipped recording: its contents, and that the command reproduces it."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from enliven.recording import Recording
from enliven_edge.assets import CHAIR
from enliven_synthesis.commands.synthesize import synthesize
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.studio import SyntheticSettings, SyntheticStudio

AGAIN = "make it again:  enliven synthesize -o edge/enliven_edge/assets/chair.mcap --overwrite"

ROUNDED_OTHERWISE = 1e-3
"""Maximum fraction of pixels that may differ on another processor, because millimetres are rounded
differently.
"""

WHOLE = 270
"""Number of frames in the shipped recording."""
MADE_AGAIN = int(os.environ.get("ENLIVEN_MADE_AGAIN", "40"))
"""Number of initial frames that the command reproduces, the slowest part of this test. `make test-long`
reproduces all.
"""


@pytest.mark.slow
def test_recording_has_nine_seconds_with_ground_truth() -> None:
    recording = Recording(CHAIR)
    assert CHAIR.stat().st_size < 3_000_000
    frames, truth = list(recording.frames()), list(recording.truth())
    assert recording.problems == [] and recording.info.complete
    assert len(frames) == len(truth) == WHOLE
    assert (
        [f.time_ns for f in frames]
        == [t.time_ns for t in truth]
        == [round(n * 1e9 / 30) for n in range(WHOLE)]
    )
    assert {f.depth.shape for f in frames} == {(240, 320)}
    assert frames[0].world_from_camera is not None
    assert recording.info.metadata["synthesize"]["choreography"] == "chair"
    for frame in frames[::30]:
        assert 0.75 < (frame.depth > 0).mean() < 0.95  # with holes, like a real depth image


@pytest.mark.slow
def test_its_images_and_joints_are_those_of_the_studio() -> None:
    """Checks sixteen of its frames, independent of compression."""
    recording = Recording(CHAIR)
    studio = SyntheticStudio(load_profile("kinect1"), SyntheticSettings(width=320))
    for n, (frame, truth) in enumerate(zip(recording.frames(), recording.truth(), strict=True)):
        if n % 17:
            continue
        assert np.mean(frame.depth != studio.frame(n).depth) < ROUNDED_OTHERWISE, AGAIN
        assert np.allclose(truth.bodies[0].joints, studio.body(frame.time_ns).joints, atol=1e-6), AGAIN


@pytest.mark.slow
def test_command_reproduces_the_shipped_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert SyntheticStudio(load_profile("kinect1"), SyntheticSettings(width=320)).frames == WHOLE, AGAIN
    monkeypatch.setattr(SyntheticStudio, "frames", MADE_AGAIN)
    synthesize(
        tmp_path / "chair.mcap", choreography="chair", profile="kinect1", seed=0, width=320, noise=True,
        level=19, overwrite=False,
    )  # fmt: skip
    reproduced, shipped = Recording(tmp_path / "chair.mcap"), Recording(CHAIR)
    about = reproduced.info.metadata["about"]
    assert about.pop("version") == "1", "recordings of 0.1, as the shipped one, state none"
    assert reproduced.info.metadata == shipped.info.metadata, AGAIN
    frames, truth = list(reproduced.frames()), list(reproduced.truth())
    assert len(frames) == len(truth) == MADE_AGAIN
    for new, old in zip(frames, shipped.frames(), strict=False):
        assert (new.time_ns, new.intrinsics) == (old.time_ns, old.intrinsics), AGAIN
        assert np.mean(new.depth != old.depth) < ROUNDED_OTHERWISE, AGAIN
    for new, old in zip(truth, shipped.truth(), strict=False):
        assert new.time_ns == old.time_ns
        assert np.allclose(new.bodies[0].joints, old.bodies[0].joints, atol=1e-6), AGAIN
