"""Tests of props on the wire: within the stated accuracy, complete in every message, and refused if
invalid.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document.props import Props
from enliven.errors import InputError
from enliven.wire import envelope, fields, streams
from enliven.wire.convert import JOINT_STEP, message_to_props, props_to_message
from enliven.wire.quaternions import MAX_ROTATION_ERROR
from enliven.wire.topics import PROPS


def some_props(count: int, seed: int = 0) -> Props:
    rng = np.random.default_rng(seed)
    turns = rng.normal(size=(count, 4))
    return Props(
        7,
        rng.permutation(60_000)[:count],
        rng.integers(0, 2, count).astype(np.uint8),
        rng.uniform(0.01, 1, (count, 3)).astype(np.float32),
        rng.integers(0, 256, (count, 3)).astype(np.uint8),
        rng.uniform(-15, 15, (count, 3)),
        turns / np.linalg.norm(turns, axis=1, keepdims=True),
        "3 of 5 boxes down",
    )


@given(count=st.integers(0, 60), seed=st.integers(0, 99))
@settings(max_examples=30, deadline=None)
def test_props_survive_the_way(count, seed):
    props = some_props(count, seed)
    _, message = envelope.unpack_stream(envelope.pack_stream(props_to_message(props)))
    back = message_to_props(message)
    assert back.time_ns == 7 and back.note == props.note and len(back) == count
    for exact in ("ids", "shapes", "colours"):
        assert np.array_equal(getattr(back, exact), getattr(props, exact))
    assert np.abs(back.positions - props.positions).max(initial=0) <= 0.5 * JOINT_STEP + 1e-9
    assert np.abs(back.sizes - props.sizes).max(initial=0) <= 0.00051
    same = np.abs((back.turns * props.turns).sum(1)).clip(0, 1)
    assert (2 * np.arccos(same)).max(initial=0) <= MAX_ROTATION_ERROR + 1e-6


def test_a_prop_that_is_nowhere_is_left_out():
    props = some_props(3)
    props.positions[1, 2] = np.nan
    assert message_to_props(props_to_message(props)).ids.tolist() == props.ids[[0, 2]].tolist()


def test_as_many_as_may_be_fit_into_a_message():
    message = props_to_message(some_props(fields.MAX_PROPS + 5))
    assert len(message.shapes) == fields.MAX_PROPS
    assert len(envelope.pack_stream(message)) < PROPS.max_bytes


def test_an_unknown_shape_is_refused():
    message = streams.PropsMessage(0, bytes(2), b"\x07", bytes(6), bytes(3), bytes(6), bytes(4))
    with pytest.raises(InputError, match="shape 7"):
        message_to_props(message)


def test_lengths_that_disagree_are_malformed():
    with pytest.raises(ValueError, match="turns"):
        streams.PropsMessage(0, bytes(2), b"\0", bytes(6), bytes(3), bytes(6), bytes(8))
