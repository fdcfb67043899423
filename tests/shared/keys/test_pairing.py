"""Tests of pairing by a code: a program without the code learns nothing and has few tries."""

from __future__ import annotations

import pytest

from enliven.keys.pairing import (
    CODE_LIFETIME_S,
    FIRST_PAUSE_S,
    MAX_PAUSE_S,
    MAX_TRIES_PER_CODE,
    Introduction,
    PairingCodes,
    PairingError,
    ViewerPairing,
    limit_role,
)

VIEWER = Introduction(b"v" * 32, "laptop", "perform")
EDGE = Introduction(b"e" * 32, "stage", "watch")


class Desk:
    """A pairing desk whose clock the test advances."""

    def __init__(self) -> None:
        self.now, self.shown = 1000.0, list[str]()
        self.desk = PairingCodes(self.shown.append, lambda: self.now)


def other_code(code: str) -> str:
    return f"{(int(code) + 1) % 1_000_000:06}"


def attempt(desk: PairingCodes, code: str) -> tuple[Introduction, Introduction]:
    """Runs the whole exchange and returns what the edge and the viewer learn."""
    viewer = ViewerPairing(code)
    edge = desk.start_pairing(viewer.message)
    learnt = edge.decrypt_introduction(viewer.encrypt_introduction(edge.message, VIEWER))
    desk.finish_pairing()
    return learnt, viewer.decrypt_introduction(edge.encrypt_introduction(EDGE))


def test_a_shared_code_exchanges_both_keys() -> None:
    at = Desk()
    at.desk.open_for(100)
    assert attempt(at.desk, at.shown[0]) == (VIEWER, EDGE)
    assert len(at.shown) == 2 and at.shown[1] == at.desk.code, "a used code is replaced"


@pytest.mark.parametrize(
    "typed", ["{0[0]}{0[1]}{0[2]} {0[3]}{0[4]}{0[5]}", "{0[0]}{0[1]}{0[2]}-{0[3]}{0[4]}{0[5]}"]
)
def test_a_code_may_be_typed_in_groups(typed: str) -> None:
    at = Desk()
    at.desk.open_for(100)
    assert attempt(at.desk, typed.format(at.shown[0])) == (VIEWER, EDGE)


@pytest.mark.parametrize("typed", ["", "12345", "1234567", "12345x", "١٢٣٤٥٦", "-12345"])
def test_what_is_no_code_is_refused_before_anything_is_sent(typed: str) -> None:
    with pytest.raises(PairingError, match="6 digits"):
        ViewerPairing(typed)


def test_without_the_code_neither_side_learns_a_key() -> None:
    at = Desk()
    at.desk.open_for(100)
    viewer = ViewerPairing(other_code(at.shown[0]))
    edge = at.desk.start_pairing(viewer.message)
    box = viewer.encrypt_introduction(edge.message, VIEWER)
    assert VIEWER.public not in box and b"laptop" not in box
    with pytest.raises(PairingError, match="the pairing code is wrong"):
        edge.decrypt_introduction(box)
    with pytest.raises(PairingError, match="another program answers"):
        viewer.decrypt_introduction(edge.encrypt_introduction(EDGE))


def test_a_box_cannot_be_sent_back_to_its_sender() -> None:
    at = Desk()
    at.desk.open_for(100)
    viewer = ViewerPairing(at.shown[0])
    edge = at.desk.start_pairing(viewer.message)
    box = viewer.encrypt_introduction(edge.message, VIEWER)
    with pytest.raises(PairingError):
        viewer.decrypt_introduction(box)


@pytest.mark.parametrize("message", [b"", b"A" + bytes(32), b"A" * 33, b"B" * 33, b"A" + b"\xff" * 32])
def test_messages_that_are_no_points_are_refused(message: bytes) -> None:
    at = Desk()
    at.desk.open_for(100)
    with pytest.raises(PairingError, match="not valid"):
        at.desk.start_pairing(message)
    viewer = ViewerPairing(at.desk.code)
    with pytest.raises(PairingError, match="not valid"):
        viewer.encrypt_introduction(message, VIEWER)


@pytest.mark.parametrize("box", [b"", bytes(39), bytes(100), bytes(512)])
def test_boxes_of_noise_are_refused(box: bytes) -> None:
    at = Desk()
    at.desk.open_for(100)
    viewer = ViewerPairing(at.shown[0])
    edge = at.desk.start_pairing(viewer.message)
    with pytest.raises(PairingError, match="code is wrong"):
        edge.decrypt_introduction(box)


def test_a_code_that_is_tried_ten_times_is_dead_after_three() -> None:
    at = Desk()
    at.desk.open_for(10_000)
    code, reasons = at.shown[0], list[str]()
    for _ in range(10):
        with pytest.raises(PairingError) as error:
            attempt(at.desk, other_code(code))
        reasons.append(str(error.value))
    assert reasons[:MAX_TRIES_PER_CODE] == ["the pairing code is wrong"] * MAX_TRIES_PER_CODE
    assert all("too many tries" in reason for reason in reasons[MAX_TRIES_PER_CODE:])
    assert at.desk.code == "" and len(at.shown) == 1
    with pytest.raises(PairingError, match="too many tries"):
        attempt(at.desk, code)
    at.now += FIRST_PAUSE_S
    assert at.desk.code == at.shown[-1] and len(at.shown) == 2
    with pytest.raises(PairingError, match="the pairing code is wrong"):
        attempt(at.desk, code if code != at.shown[-1] else other_code(code))


def test_an_exchange_that_is_never_finished_counts_as_a_try() -> None:
    at = Desk()
    at.desk.open_for(100)
    for _ in range(MAX_TRIES_PER_CODE):
        at.desk.start_pairing(ViewerPairing(at.shown[0]).message)
    assert at.desk.code == ""


def test_the_pause_doubles_up_to_its_maximum_and_a_success_ends_that() -> None:
    at, pauses = Desk(), list[float]()
    at.desk.open_for(100_000)
    for _ in range(8):
        code = at.desk.code
        for _ in range(MAX_TRIES_PER_CODE):
            at.desk.start_pairing(ViewerPairing(code).message)
        pauses.append(at.desk.pause_s)
        at.now += pauses[-1]
    assert pauses[:5] == [FIRST_PAUSE_S * 2**k for k in range(5)] and pauses[-1] == MAX_PAUSE_S
    attempt(at.desk, at.desk.code)
    for _ in range(MAX_TRIES_PER_CODE):
        at.desk.start_pairing(ViewerPairing("123456").message)
    assert at.desk.pause_s == FIRST_PAUSE_S


def test_opening_again_does_not_shorten_a_pause() -> None:
    at = Desk()
    at.desk.open_for(100)
    for _ in range(MAX_TRIES_PER_CODE):
        at.desk.start_pairing(ViewerPairing("123456").message)
    at.desk.open_for(500)
    assert at.desk.code == ""


def test_a_code_expires_and_pairing_closes() -> None:
    at = Desk()
    assert at.desk.code == "" and at.desk.seconds_left == 0
    at.desk.open_for(1.5 * CODE_LIFETIME_S)
    first = at.desk.code
    assert at.desk.seconds_left == CODE_LIFETIME_S
    at.now += CODE_LIFETIME_S
    assert at.desk.code != "" and len(at.shown) == 2
    if first != at.shown[1]:
        with pytest.raises(PairingError, match="the pairing code is wrong"):
            attempt(at.desk, first)
    at.now += CODE_LIFETIME_S
    with pytest.raises(PairingError, match=r"pairing is closed.*--show-code"):
        attempt(at.desk, at.shown[1])
    assert len(at.shown) == 2


def test_a_role_is_limited_to_the_highest_that_the_edge_grants() -> None:
    assert limit_role("operate", "perform") == "perform" and limit_role("watch", "perform") == "watch"
