"""Tests that the panel's messages are found in noise, and that presses are counted from the received
counters.
"""

from __future__ import annotations

import tracemalloc
from itertools import accumulate

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from enliven.health import Severity
from enliven_edge.controls.panel_protocol import (
    Decoder,
    Lamps,
    PanelKeys,
    encode,
    lamps_from_state,
    lamps_message_body,
)

letters = st.characters(min_codepoint=0x20, max_codepoint=0x7E, exclude_characters="$*")
bodies = st.lists(st.text(letters, min_size=1, max_size=20), min_size=1, max_size=6)
noises = st.one_of(st.binary(max_size=40), st.text("$*\nP0", max_size=40).map(str.encode))


def sent(beat: int, counts: list[int]) -> bytes:
    """Returns a panel's message for these numbers of presses."""
    return encode(f"P{beat % 0x10000:04X}" + "".join(f"{count % 16:X}" for count in counts))


def test_message_bytes_match_the_protocol():
    assert encode("H01P") == b"$H01P*42AB\n"
    assert lamps_message_body(Lamps("breathing", "steady", "off", "flashing")) == "LBS-F"


@given(st.binary(max_size=300))
@example(b"$" + 300 * b"x")
def test_any_bytes_are_read(noise):
    decoder, keys = Decoder(), PanelKeys()
    decoder.feed(noise * 3)
    keys.feed(noise)


def test_a_message_that_does_not_end_takes_no_room():
    decoder, piece = Decoder(), b"x" * 100
    assert decoder.feed(encode("x" * 59)) == ["x" * 59] and decoder.feed(encode("x" * 60)) == []
    tracemalloc.start()
    try:
        assert decoder.feed(b"$") == [] and all(decoder.feed(piece) == [] for _ in range(1000))
        assert tracemalloc.get_traced_memory()[1] < 10_000
    finally:
        tracemalloc.stop()


def test_zero_bytes_in_front_of_a_body_are_refused():
    """The checksum is the same with them."""
    assert Decoder().feed(encode("P0").replace(b"$", b"$\x00")) == []


@given(bodies, st.data())
def test_a_message_survives_being_split_anywhere(messages, data):
    stream = b"".join(map(encode, messages))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    decoder, decoded = Decoder(), []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        decoded += decoder.feed(stream[start:end])
    assert decoded == messages


@given(bodies, st.lists(noises, min_size=7, max_size=7))
def test_noise_between_messages_loses_none(messages, noise):
    assume(not any(Decoder().feed(part) for part in noise))
    stream = (
        b"".join(before + encode(body) for before, body in zip(noise, messages, strict=False)) + noise[-1]
    )
    assert Decoder().feed(stream) == messages


@given(bodies, st.data(), st.binary(min_size=1, max_size=12))
def test_noise_on_a_message_loses_no_other(messages, data, noise):
    assume(not Decoder().feed(noise))
    lines = [encode(body) for body in messages]
    hit = data.draw(st.integers(0, len(lines) - 1))
    start = data.draw(st.integers(0, len(lines[hit])))
    end = data.draw(st.integers(start, len(lines[hit])))
    spoilt = lines[hit][:start] + noise + lines[hit][end:]
    decoded = Decoder().feed(b"".join([*lines[:hit], spoilt, *lines[hit + 1 :]]))
    others = messages[:hit] + messages[hit + 1 :]
    assert decoded in (others, messages)


@given(st.lists(st.tuples(st.integers(1, 9), st.booleans()), max_size=40))
def test_presses_of_lost_messages_are_made_good_and_none_is_heard_twice(presses):
    keys, counts, heard = PanelKeys(), [0] * 9, []
    keys.feed(sent(0, counts))
    for place, (button, lost) in enumerate(presses):
        counts[button - 1] += 1
        if not lost or place % 7 == 6:
            heard += keys.feed(sent(0, counts))
    heard += keys.feed(sent(1, counts))
    assert sorted(heard) == sorted(str(button) for button, _ in presses)


@given(st.lists(st.integers(0, 15), min_size=9, max_size=9), st.integers(0, 0xFFFF))
def test_presses_before_the_first_message_are_ignored(counts, beat):
    keys = PanelKeys()
    assert keys.feed(sent(beat, counts)) == []
    counts[4] += 1
    assert keys.feed(sent(beat + 1, counts)) == ["5"]
    keys.forget()
    counts[4] += 1
    assert keys.feed(sent(beat + 2, counts)) == []


@given(st.lists(st.integers(0, 15), min_size=9, max_size=9), st.integers(9, 0xFFFF - 9))
def test_a_panel_that_was_started_again_has_pressed_nothing(counts, beat):
    keys = PanelKeys()
    keys.feed(sent(beat, counts))
    assert keys.feed(sent(0, [0] * 9)) == []
    assert keys.feed(sent(0, [1] + [0] * 8)) == ["1"]


@given(st.lists(st.integers(1, 8), max_size=30), st.integers(0xFFE0, 0xFFFF))
def test_beats_count_on_through_their_end(steps, first):
    keys = PanelKeys()
    keys.feed(sent(first, [0]))
    events = [keys.feed(sent(beat, [n])) for n, beat in enumerate(accumulate(steps, initial=first))]
    assert events == [[], *[["1"]] * len(steps)]


@pytest.mark.parametrize("body", ["H1P", "H01X", "P000", "P0000", "P0000G", "Q", "P" + "0" * 40, "H01P ", ""])
def test_message_of_another_protocol_is_ignored(body):
    keys = PanelKeys()
    assert keys.feed(encode(body)) == [] and keys.version == ""


def test_greeting_contains_protocol_and_cause():
    keys = PanelKeys()
    keys.feed(encode("H02W"))
    assert (keys.version, keys.cause, keys.received) == ("02", "W", 1)
    keys.feed(b"")
    assert (keys.version, keys.cause) == ("02", ""), "it is said once"


def test_lamps_of_each_state_of_the_stage():
    quiet = {
        "is_performer_present": False,
        "is_character_held": False,
        "locked": False,
        "highest_severity": Severity.NOTE,
    }
    for state, lamps in (
        ({}, Lamps(attract="breathing")),
        ({"is_performer_present": True}, Lamps(possess="breathing")),
        ({"is_performer_present": True, "is_character_held": True}, Lamps(possess="steady")),
        ({"locked": True}, Lamps(attract="breathing", locked="steady")),
        ({"highest_severity": Severity.WARNING}, Lamps(attract="breathing", fault="steady")),
        ({"highest_severity": Severity.ERROR}, Lamps(attract="breathing", fault="flashing")),
    ):
        assert lamps_from_state(**{**quiet, **state}) == lamps
