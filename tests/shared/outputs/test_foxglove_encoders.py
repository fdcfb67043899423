"""Tests that templates of Foxglove's messages have the bytes or values that its SDK encodes."""

import json

import numpy as np
import pytest

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed (the extra foxglove)")

from foxglove.messages import FrameTransforms, SceneUpdate, Timestamp
from hypothesis import assume, given
from hypothesis import strategies as st
from live_scenes import random_frame

from enliven.outputs.foxglove.stage_encoders import (
    SceneEncoder,
    StageEncoder,
    TransformsEncoder,
    scene,
    scene_numbers,
    transforms,
)
from enliven.person import Joint

SEEDS = st.integers(0, 2**32 - 1)
TIMES = st.builds(
    lambda seconds, nanoseconds: seconds * 10**9 + nanoseconds,
    *(st.integers(1_600_000_000, 4_000_000_000), st.integers(2**28, 10**9 - 1)),
)
"""Times whose two numbers the SDK encodes in five bytes each, as the templates always do."""


@pytest.mark.slow
@given(SEEDS, TIMES)
def test_transforms_have_the_bytes_of_the_sdk(seed, time_ns):
    frame = random_frame(seed)
    rows = frame.rows
    numbers = rows.values[:, [0, 1, 2, 4, 5, 6, 3]]
    expected = transforms(rows.labels(), numbers.ravel(), Timestamp(*divmod(time_ns, 10**9))).encode()
    assume(np.all(numbers))  # The SDK leaves out zeros.
    assert TransformsEncoder().encode(frame, time_ns) == expected


@pytest.mark.slow
@given(SEEDS, TIMES)
def test_the_drawing_has_the_bytes_of_the_sdk(seed, time_ns):
    frame = random_frame(seed)
    numbers = scene_numbers(frame)
    expected = scene(frame, numbers, Timestamp(*divmod(time_ns, 10**9))).encode()
    assume(np.all(numbers))
    assert SceneEncoder().encode(frame, time_ns) == expected


@pytest.mark.slow
@given(SEEDS, st.integers(0, 4 * 10**18))
def test_any_time_and_zeros_are_read_by_protobuf(seed, time_ns):
    pytest.importorskip("google.protobuf", reason="protobuf is not installed")
    from foxglove_client import read_message

    frame = random_frame(seed)
    frame.rows.values[::2] = 0.0
    stamp = Timestamp(*divmod(time_ns, 10**9))
    names, numbers = frame.rows.labels(), frame.rows.values[:, [0, 1, 2, 4, 5, 6, 3]].ravel()
    for schema, fast, slow in (
        (
            FrameTransforms.get_schema(),
            TransformsEncoder().encode(frame, time_ns),
            transforms(names, numbers, stamp).encode(),
        ),
        (
            SceneUpdate.get_schema(),
            SceneEncoder().encode(frame, time_ns),
            scene(frame, scene_numbers(frame), stamp).encode(),
        ),
    ):
        read = [str(read_message(schema.name, schema.data, data)) for data in (fast, slow)]
        assert read[0] == read[1]


@pytest.mark.slow
@given(SEEDS)
def test_one_encoder_serves_changing_stages(seed):
    encoder, plots = TransformsEncoder(), StageEncoder()
    for number in range(4):
        frame = random_frame(seed + number)
        assert encoder.encode(frame, 10**18) == TransformsEncoder().encode(frame, 10**18)
        assert plots.encode(frame) == StageEncoder().encode(frame)


@pytest.mark.slow
@given(SEEDS)
def test_numbers_for_plots_are_those_of_the_bodies(seed):
    frame = random_frame(seed)
    stage = json.loads(StageEncoder().encode(frame))
    assert stage["characters"] == [
        {"name": pose.character, "held": pose.character in frame.held} for pose in frame.poses
    ]
    for sent, (number, body) in zip(stage["performers"], frame.performers.items(), strict=True):
        assert sent["number"] == number and sent["height"] == pytest.approx(body.height, abs=1e-6)
        contacts = (0.0, 0.0) if body.contacts is None else body.contacts
        assert [sent["contact"][side] for side in ("left", "right")] == pytest.approx(contacts, abs=1e-6)
        for joint, row in zip(Joint, sent["joints"], strict=True):
            assert row["name"] == joint.name.lower()
            assert [row[axis] for axis in "xyz"] == pytest.approx(body.joints[joint].tolist(), abs=1e-6)
            assert row["confidence"] == pytest.approx(body.confidence[joint], abs=1e-6)


@pytest.mark.slow
@given(SEEDS, st.sampled_from([np.nan, np.inf, -np.inf]))
def test_numbers_that_are_not_finite_become_zero(seed, bad):
    frame = random_frame(seed)
    clean = TransformsEncoder().encode(frame, 10**18)
    chosen = frame.rows.values.ravel()[::5].copy()
    frame.rows.values.reshape(-1)[::5] = 0.0
    zeros = TransformsEncoder().encode(frame, 10**18)
    frame.rows.values.reshape(-1)[::5] = bad
    assert TransformsEncoder().encode(frame, 10**18) == zeros
    assert not len(chosen) or zeros != clean
