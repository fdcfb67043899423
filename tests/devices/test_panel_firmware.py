"""Tests of the panel's firmware alone, in a simulator. Each test advances the board's own time."""

import itertools
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st

from enliven_edge.controls.panel_protocol import Decoder, Lamps, PanelKeys, encode, lamps_message_body

sys.path.insert(0, str(Path(__file__).parent))

from panel_for_tests import BUTTONS, LAMPS, MatchList

LIT = Lamps(attract="breathing", possess="steady", locked="off", fault="flashing")
NO_EDGE = 0.05
"""Fraction of time for which all lamps are lit without an edge: 100 ms of 2048."""


@pytest.fixture
def board(firmware):
    opened = MatchList(firmware)
    yield opened
    opened.close()


def counts(said: bytes) -> str:
    """Returns how often each button was pressed, from the last message."""
    return [body for body in Decoder().feed(said) if body[0] == "P"][-1][5:]


def lit(board: MatchList, milliseconds: int = 400, edge: Lamps | None = None) -> dict[str, float]:
    """Returns the fraction of time for which each lamp is lit, with an edge that sends five times per
    second."""
    before = {name: board.lamp(name)[0] for name in LAMPS}
    for _ in range(milliseconds // 200):
        if edge is not None:
            board.feed(encode(lamps_message_body(edge)))
        board.run(200)
    return {name: (board.lamp(name)[0] - before[name]) * 1000.0 / milliseconds for name in LAMPS}


def test_panel_greets_then_sends_four_times_per_second(board):
    bodies = Decoder().feed(board.run(2010))
    assert bodies == ["H01P", *(f"P{beat:04X}000000000" for beat in range(9))]


def test_panel_greets_again_on_request(board):
    board.run(100)
    board.feed(encode("?"))
    assert Decoder().feed(board.run(20)) == ["H01P"]


@pytest.mark.parametrize("button", range(1, len(BUTTONS) + 1))
def test_each_button_counts_its_own_presses(board, button):
    output = board.run(50)
    for _ in range(2):
        board.press(button, True)
        output += board.run(30)
        board.press(button, False)
        output += board.run(30)
    assert counts(output) == "".join("2" if place == button else "0" for place in range(1, 10))
    keys = PanelKeys()
    assert keys.feed(output) == [str(button)] * 2


def test_press_is_sent_within_30_ms(board):
    board.run(100)
    board.press(3, True)
    assert counts(board.run(30)) == "001000000"


def test_bouncing_or_held_contact_is_one_press(board):
    output = board.run(50)
    for edge in (True, False):
        for bounce in range(13):
            board.press(1, edge == (bounce % 2 == 0))
            output += board.run(1.3)
        output += board.run(600)
    assert counts(output) == "100000000"


def test_spike_on_the_wire_is_not_a_press(board):
    board.run(50)
    for _ in range(20):
        board.press(2, True)
        board.run(6)
        board.press(2, False)
        board.run(15)
    assert counts(board.run(300)) == "000000000"


def test_button_held_at_start_is_not_a_press(board):
    board.press(4, True)
    assert counts(board.run(300)) == "000000000"
    board.press(4, False)
    board.run(50)
    board.press(4, True)
    assert counts(board.run(300)) == "000100000"


def test_simultaneous_presses_are_all_heard(board):
    board.run(50)
    for button in range(1, 10):
        board.press(button, True)
    assert counts(board.run(40)) == "111111111"


def test_lamps_show_the_edges_state(board):
    lit(board, 200, edge=LIT)
    before = board.lamp("ill")[1]
    shares = lit(board, 4000, edge=LIT)
    changes = board.lamp("ill")[1] - before
    assert shares["possess"] == pytest.approx(1.0, abs=0.01) and shares["locked"] == 0.0
    assert shares["ill"] == pytest.approx(0.5, abs=0.05)
    assert changes in (15, 16, 17), "about two flashes a second"
    assert 0.2 < shares["attract"] < 0.5
    brightness = [lit(board, 200, edge=LIT)["attract"] for _ in range(21)]
    assert min(brightness) < 0.03 and max(brightness) > 0.9, "it goes from nearly dark to bright"
    steps = [abs(a - b) for a, b in itertools.pairwise(brightness)]
    assert max(steps) < 0.2, "it breathes and does not blink"
    lit(board, 200, edge=Lamps())
    assert lit(board, 400, edge=Lamps()) == dict.fromkeys(LAMPS, 0.0)


def test_all_lamps_show_a_silent_edge_until_it_speaks_again(board):
    one_flash = pytest.approx(dict.fromkeys(LAMPS, NO_EDGE), abs=0.01)
    assert lit(board, 2000) == one_flash, "before an edge has ever spoken"
    steady = Lamps(possess="steady")
    assert lit(board, 800, edge=steady)["possess"] == pytest.approx(1.0, abs=0.01)
    assert lit(board, 600)["possess"] == pytest.approx(1.0, abs=0.01), "a lost message or two are nothing"
    board.run(600)
    assert lit(board, 2000) == one_flash
    assert lit(board, 800, edge=steady)["attract"] == 0.0


@pytest.mark.parametrize(
    "bad",
    [
        b"$LSSSS*0000\n",
        encode("LSSS"),
        encode("LSSSSS"),
        encode("lSSSS"),
        encode("LSSSS").lower().replace(b"l", b"L"),
        encode("LSSSS").replace(b"\n", b"x\n"),
        b"$" + b"L" * 256 + encode("LSSSS")[1:],
        encode("LSSSS")[1:],
    ],
)
def test_invalid_message_changes_no_lamp(board, bad):
    board.run(50)
    board.feed(encode("L----"))
    board.run(20)
    for start in range(0, len(bad), 40):
        board.feed(bad[start : start + 40])
        board.run(20)
    assert lit(board, 200) == dict.fromkeys(LAMPS, 0.0)
    assert counts(board.run(300)) == "000000000"
    board.feed(encode("LSSSS"))
    board.run(20)
    assert lit(board, 200) == pytest.approx(dict.fromkeys(LAMPS, 1.0), abs=0.01), "a right one does"


def test_framing_error_spoils_only_its_message(board):
    board.run(50)
    board.feed(encode("L----"))
    board.run(20)
    message = encode("L-S--")
    board.feed(message[:4])
    board.feed_broken(message[4])
    board.feed(message[5:])
    assert lit(board, 200)["possess"] == 0.0
    board.feed(message)
    board.run(20)
    assert lit(board, 200)["possess"] == pytest.approx(1.0, abs=0.01)


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=150), st.booleans())
@example(b"$LSSSS*", False)
@example(b"$" * 100, True)
@example(b"\n" * 100, False)
def test_message_after_noise_is_heard(board, noise, steady):
    heard = Decoder().feed(noise)
    assume(not heard)
    for start in range(0, len(noise), 40):
        board.feed(noise[start : start + 40])
        board.run(15)
    board.feed(encode(lamps_message_body(Lamps(locked="steady" if steady else "off"))))
    board.run(15)
    assert lit(board, 200)["locked"] == pytest.approx(float(steady), abs=0.01)


def test_oversized_message_is_dropped_and_panel_continues(board):
    output = board.run(50)
    for _ in range(20):
        board.feed(encode("?") * 7)
        output += board.run(15)
    output += board.run(200)
    greetings = Decoder().feed(output).count("H01P")
    assert 20 < greetings < 140, "it cannot answer as fast as it is asked"
    assert len(Decoder().feed(output)) == output.count(b"$") == output.count(b"\n"), "no message is cut short"
    board.press(1, True)
    assert counts(board.run(300)) == "100000000"


@pytest.mark.parametrize("bytes_sent", [1, 2, 8, 16, 19])
def test_reset_in_mid_message_is_followed_by_whole_messages(board, bytes_sent):
    output = board.run(100)
    board.reset_after(bytes_sent)
    output += board.run(1000)
    bodies = Decoder().feed(output)
    assert "H01E" in bodies
    after = bodies[bodies.index("H01E") + 1 :]
    assert after[:3] == ["P0000000000000", "P0001000000000", "P0002000000000"]
    assert PanelKeys().feed(output) == []


@pytest.mark.parametrize("interrupts_too", [False, True])
def test_watchdog_restarts_a_hanging_program(board, interrupts_too):
    board.run(700)
    board.hang(interrupts_too)
    assert board.run(200) == b"" or not interrupts_too
    bodies = Decoder().feed(board.run(150))
    assert bodies[:2] == ["H01W", "P0000000000000"]
    board.press(9, True)
    assert counts(board.run(300)) == "000000001", "it works as before"
    board.feed(encode("?"))
    assert "H01W" in Decoder().feed(board.run(20)), "why it started is said to an edge that comes later"
