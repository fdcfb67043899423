"""Detects the image protocol of a terminal, from environment variables or by a query."""

from __future__ import annotations

import contextlib
import os
import re
import select
import time
from collections.abc import Iterator, Mapping
from typing import TextIO

from enliven_edge.terminal.image_encoding import ImageProtocol

ANSWER_TIMEOUT_S = 1.0
"""Maximum seconds to wait for a terminal's answer. It allows for slow network connections, although nearly
all terminals answer immediately."""
_QUERY = b"\x1b_Gi=31,s=1,v=1,a=q,t=d,f=24;AAAA\x1b\\\x1b[c"
"""Query of the support of kitty graphics, then of the device attributes (DA1). Every terminal answers the
second query, and the answers arrive in this order."""
_ERASE = b"\r\x1b[K"
"""Sequence that erases the query if an old terminal printed it."""
_PRINTS_QUERY = ("linux", "Apple_Terminal")
"""Terminals that would print the first query. They cannot draw images."""
_ATTRIBUTES = re.compile(rb"\x1b\[\?([\d;]*)c")
_SIXEL = b"4"
"""The device attribute of a terminal that supports sixels."""
_MAX_ANSWER_BYTES = 4096
"""Maximum bytes of an answer. Further bytes are typed by the user, so reading stops."""


def image_protocol(
    out: TextIO, keys: TextIO, environment: Mapping[str, str] = os.environ, patience: float = ANSWER_TIMEOUT_S
) -> ImageProtocol | None:
    """Returns the image protocol of ``out``. Returns None if it is not a terminal, or cannot draw images.

    Args:
        keys: the stream of the terminal's answers.
        patience: seconds to wait for an answer. If 0, the terminal is not queried.
    """
    if not out.isatty() or environment.get("TERM", "dumb") == "dumb":
        return None
    if from_environment := _protocol_from_environment(environment):
        return from_environment
    named_so = {environment.get("TERM"), environment.get("TERM_PROGRAM")}
    supported = patience > 0 and keys.isatty() and not named_so.intersection(_PRINTS_QUERY)
    if supported and (answer := _query_terminal(out.fileno(), keys.fileno(), patience)):
        if b"_Gi=31;OK" in answer:
            return "kitty"
        attributes = _ATTRIBUTES.search(answer)
        if attributes and _SIXEL in attributes[1].split(b";"):
            return "sixel"
    if "utf" not in (out.encoding or "").lower():
        return None
    return "blocks" if environment.get("COLORTERM") in ("truecolor", "24bit") else "blocks256"


def _protocol_from_environment(environment: Mapping[str, str]) -> ImageProtocol | None:
    """Returns the protocol that the environment variables indicate.

    Returns None in a terminal multiplexer, which may not forward images.
    """
    if environment.get("TMUX") or environment.get("TERM", "").startswith(("screen", "tmux")):
        return None
    program = environment.get("TERM_PROGRAM") or environment.get("LC_TERMINAL", "")
    if environment.get("KITTY_WINDOW_ID") or environment.get("TERM") in ("xterm-kitty", "xterm-ghostty"):
        return "kitty"
    return "iterm" if program in ("iTerm.app", "iTerm2", "WezTerm") else None


def _query_terminal(out: int, keys: int, patience: float) -> bytes:
    """Returns the terminal's answer. The result is empty if it does not answer in time, or cannot be
    queried.
    """
    with _disable_echo(keys) as is_possible:
        if not is_possible:
            return b""
        os.write(out, _QUERY)
        answer, deadline = b"", time.monotonic() + patience
        while not _ATTRIBUTES.search(answer) and len(answer) < _MAX_ANSWER_BYTES:
            if not select.select([keys], [], [], max(0.0, deadline - time.monotonic()))[0]:
                break
            if not (data := os.read(keys, _MAX_ANSWER_BYTES)):
                break
            answer += data
        os.write(out, _ERASE)
        return answer


@contextlib.contextmanager
def _disable_echo(keys: int) -> Iterator[bool]:
    """Turns off echo and line buffering temporarily. Yields False if that is not possible."""
    try:
        import termios
        import tty

        old_attributes = termios.tcgetattr(keys)
        # If a background program reads from the terminal, the system stops it. So do not read in that case.
        is_possible = os.tcgetpgrp(keys) == os.getpgrp()
    except (ImportError, OSError, termios.error):
        yield False
        return
    if not is_possible:
        yield False
        return
    tty.setcbreak(keys, termios.TCSANOW)
    try:
        yield True
    finally:
        # Discard the rest of a late answer, so that it does not appear at the user's prompt.
        termios.tcsetattr(keys, termios.TCSAFLUSH, old_attributes)
