"""Tests that takes of joints store every measured frame, including incomplete ones."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enliven.document import BodyTake
from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.motion_clips.body_takes import body_take_from_file, body_take_from_frames
from enliven.person import Body
from enliven.recording import Recorder

people_in_view = st.lists(st.sets(st.integers(0, 4), max_size=3), min_size=1, max_size=8)


def frames_of(in_view, seed: int) -> list[BodyFrame]:
    random = np.random.default_rng(seed)
    return [
        BodyFrame(
            [Body(i, random.normal(size=(20, 3)), random.uniform(size=20)) for i in sorted(who)],
            5_000_000_000 + 33_000_000 * n,
            "kinect",
        )
        for n, who in enumerate(in_view)
    ]


@given(people_in_view, st.integers(0, 99))
def test_frames_are_returned_unchanged(in_view, seed):
    frames = frames_of(in_view, seed)
    begin = next((i for i, who in enumerate(in_view) if who), None)
    if begin is None:
        with pytest.raises(InputError, match="no performer"):
            body_take_from_frames(frames, "empty")
        return
    take = body_take_from_frames([*frames, frames[-1]], "take")
    assert len(take.seconds) == len(frames) - begin
    for n, frame in enumerate(frames[begin:]):
        assert take.seconds[n] == pytest.approx(0.033 * n, abs=1e-9)
        for again, body in zip(take.bodies(n), frame.bodies, strict=True):
            assert again.id == body.id
            np.testing.assert_array_equal(again.joints, body.joints)
            np.testing.assert_array_equal(again.confidence, body.confidence)


def test_a_joint_that_is_no_number_is_unseen():
    (frame,) = frames_of([{1}], 0)
    frame.bodies[0].joints[7] = np.nan
    (body,) = body_take_from_frames([frame], "take").bodies(0)
    assert body.confidence[7] == 0.0 and np.isfinite(body.joints).all() and body.confidence[6] > 0.0


def test_a_recording_is_a_take(tmp_path):
    with Recorder(tmp_path / "show.mcap") as recorder:
        for frame in frames_of([set(), {3}, {3, 4}], 1):
            recorder.write_frame(frame)
    take = body_take_from_file(tmp_path / "show.mcap")
    assert take.id == "show" and take.people.tolist() == [3, 4]
    assert take.present.tolist() == [[True, False], [True, True]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seconds": [0.0, 0.0]}, "do not increase"),
        ({"seconds": [1.0, 2.0]}, "do not increase from 0"),
        ({"people": [1, 1]}, "joints"),
        ({"joints": np.full((2, 1, 20, 3), np.nan)}, "not a finite number"),
        ({"confidence": np.full((2, 1, 20), 1.5)}, "confidence"),
    ],
)
def test_inconsistent_take_is_refused(change, message):
    whole = {
        "seconds": [0.0, 0.1],
        "people": [1],
        "joints": np.zeros((2, 1, 20, 3)),
        "confidence": np.ones((2, 1, 20)),
        "present": np.ones((2, 1), bool),
    }
    with pytest.raises(InputError, match=message):
        BodyTake("take", **{**whole, **change})
