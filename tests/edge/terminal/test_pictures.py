"""Tests of terminal images by decoding them. A terminal is queried for its features, a pipe is not."""

import io
import os
import re
import select
import subprocess
import sys
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from screen import drawn_by_iterm, drawn_by_kitty, drawn_by_sixel, drawn_in_half_blocks

from enliven import cli
from enliven_edge.doctor import find_shipped_recording
from enliven_edge.terminal.image_encoding import encode_half_blocks, encode_image
from enliven_edge.terminal.protocol_query import image_protocol

PATIENCE = 60.0
"""Timeout in seconds for a loaded machine."""
QUESTION = b"\x1b_Gi=31,s=1,v=1,a=q,t=d,f=24;AAAA\x1b\\\x1b[c"


@st.composite
def pictures(draw) -> np.ndarray:
    """Returns (H, W, 3) images of few colours, so that a palette is exact."""
    height, width = draw(st.integers(1, 30)), draw(st.integers(1, 70))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    palette = rng.integers(0, 256, (draw(st.integers(1, 12)), 3)).astype(np.uint8)
    return palette[rng.integers(0, len(palette), (height, width))]


@given(pictures())
@settings(deadline=None, max_examples=60)
def test_each_protocol_draws_the_picture(picture):
    np.testing.assert_array_equal(drawn_by_kitty(encode_image(picture, "kitty")), picture)
    np.testing.assert_array_equal(drawn_by_iterm(encode_image(picture, "iterm")), picture)
    # Sixels have a hundred levels per colour channel.
    sixel = drawn_by_sixel(encode_image(picture, "sixel"))
    assert sixel.shape == picture.shape and np.abs(sixel.astype(int) - picture).max() <= 2
    blocks = drawn_in_half_blocks(encode_image(picture, "blocks"))
    np.testing.assert_array_equal(blocks[: len(picture)], picture)


def test_a_large_picture_is_sent_in_pieces_and_made_to_fit():
    picture = np.random.default_rng(0).integers(0, 256, (300, 400, 3)).astype(np.uint8)
    np.testing.assert_array_equal(drawn_by_kitty(encode_image(picture, "kitty")), picture)
    assert drawn_in_half_blocks(encode_image(picture, "blocks", 40)).shape == (30, 40, 3)
    wide = drawn_by_sixel(encode_image(np.zeros((300, 1200, 3), np.uint8), "sixel"))
    assert wide.shape == (120, 480, 3)


def test_older_terminals_get_one_of_their_fixed_colours():
    text = encode_half_blocks(
        np.array([[[0, 0, 0], [255, 0, 0]], [[255, 255, 255], [0, 0, 255]]], np.uint8), False
    )
    assert re.findall(r"38;5;(\d+);48;5;(\d+)", text) == [("232", "255"), ("196", "21")]


class Screen(io.StringIO):
    """A simulated terminal that must not be queried."""

    encoding = "utf-8"

    def isatty(self):
        return True


@pytest.mark.parametrize(
    ("environment", "way"),
    [
        ({"TERM": "xterm-kitty"}, "kitty"),
        ({"TERM": "xterm-256color", "KITTY_WINDOW_ID": "1"}, "kitty"),
        ({"TERM": "xterm-256color", "TERM_PROGRAM": "iTerm.app"}, "iterm"),
        ({"TERM": "xterm-256color", "TERM_PROGRAM": "iTerm.app", "TMUX": "x"}, "blocks256"),
        ({"TERM": "xterm-256color", "COLORTERM": "truecolor"}, "blocks"),
        ({"TERM": "linux"}, "blocks256"),
        ({"TERM": "dumb", "COLORTERM": "truecolor"}, None),
        ({}, None),
    ],
)
def test_environment_selects_the_image_protocol(environment, way):
    assert image_protocol(Screen(), Screen(), environment, patience=0.0) == way
    assert image_protocol(io.StringIO(), Screen(), environment) is None, "a pipe or a file gets no picture"


def at_a_terminal(*words: str) -> tuple[subprocess.Popen, int]:
    """Runs a program on a pseudo-terminal. Returns the program and the other end."""
    import fcntl
    import termios

    near, far = os.openpty()
    environment = {key: value for key, value in os.environ.items() if key not in ("COLORTERM", "TMUX")}
    environment |= {"TERM": "xterm-256color", "PYTHONIOENCODING": "utf-8", "COLUMNS": "60"}
    for named in ("KITTY_WINDOW_ID", "TERM_PROGRAM", "LC_TERMINAL"):
        environment.pop(named, None)
    program = subprocess.Popen(
        [sys.executable, *words],
        stdin=far,
        stdout=far,
        stderr=subprocess.PIPE,
        env=environment,
        start_new_session=True,
        preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
    )
    os.close(far)
    return program, near


def read_until(near: int, mark: bytes) -> bytes:
    """Returns the program's output up to a mark."""
    seen, until = b"", time.monotonic() + PATIENCE
    while mark not in seen and select.select([near], [], [], max(0.0, until - time.monotonic()))[0]:
        try:
            seen += os.read(near, 1)
        except OSError:
            break
    assert mark in seen, seen
    return seen


ANSWERS = {"kitty": b"\x1b_Gi=31;OK\x1b\\\x1b[?62;c", "sixel": b"\x1b[?62;4;22c", "blocks256": b"\x1b[?1;2c"}


@pytest.mark.skipif(os.name != "posix", reason="there are no terminals of this kind here")
def test_terminal_query_times_out_without_an_answer():
    code = (
        "import sys, termios\n"
        "from enliven_edge.terminal.protocol_query import image_protocol\n"
        "before = termios.tcgetattr(0)\n"
        "for patience in (60.0, 60.0, 60.0, 0.05):\n"
        "    print(image_protocol(sys.stdout, sys.stdin, patience=patience), 'found', flush=True)\n"
        "assert termios.tcgetattr(0) == before\n"
    )
    program, near = at_a_terminal("-c", code)
    try:
        for way, answer in ANSWERS.items():
            read_until(near, QUESTION)
            os.write(near, answer)
            reply = read_until(near, b"found\r\n")
            assert reply == b"\r\x1b[K" + f"{way} found\r\n".encode(), "the answer is not echoed"
        read_until(near, QUESTION)
        assert b"blocks256 found" in read_until(near, b"found")
        assert program.wait(PATIENCE) == 0, program.stderr.read()
    finally:
        program.kill()
        program.wait()
        program.stderr.close()
        os.close(near)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="there are no terminals of this kind here")
def test_the_command_draws_the_depth_at_a_terminal():
    words = ["sensors", "replay", "--set", f"path={find_shipped_recording()}", "--seconds", "0.1"]
    program, near = at_a_terminal("-m", "enliven", *words)
    try:
        os.write(near, ANSWERS["sixel"])  # at once: a loaded machine may exceed the timeout
        text = read_until(near, b"\x1b\\\r\n").decode().replace("\r\n", "\n")
        assert program.wait(PATIENCE) == 0, program.stderr.read()
    finally:
        program.kill()
        program.wait()
        program.stderr.close()
        os.close(near)
    picture = drawn_by_sixel(text[text.index("\x1bP") :])
    assert picture.shape == (240, 320, 3) and picture.std() > 10
    assert "320 x 240" in text[: text.index("\x1bP")]


def test_pipe_gets_only_text_unless_a_protocol_is_named(capsys):
    words = ["sensors", "replay", "--set", f"path={find_shipped_recording()}", "--seconds", "0.1"]
    assert cli.run(words) == 0
    assert "\x1b" not in capsys.readouterr().out
    assert cli.run([*words, "--picture", "kitty"]) == 0
    out = capsys.readouterr().out
    assert drawn_by_kitty(out).shape == (240, 320, 3)
    assert cli.run([*words, "--picture", "blocks"]) == 0
    out = capsys.readouterr().out
    assert drawn_in_half_blocks(out[out.index("\x1b") :]).shape == (60, 80, 3)
    assert cli.run([*words, "--picture", "oils"]) == 3
    assert "blocks256" in capsys.readouterr().err
