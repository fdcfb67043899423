"""The messages between an edge and its button panel, as in docs/panel.md; nothing here waits or raises."""

from __future__ import annotations

import binascii
import re
from dataclasses import astuple

from enliven_edge.controls.lamps import Lamps

VERSION = "01"
"""The protocol that this edge speaks, two digits of the panel's greeting."""
ASK = "?"
"""The body of a message that requests the panel's greeting."""
_LONGEST = 64
"""Bytes of a body and its checksum; what is longer is noise. The panel's longest are 19."""
_MOST_BEATS = 12
"""The panel beats four times a second; where more beats are missing, it restarted or was not received."""
_MOST_PRESSES = 7
"""Presses between two messages, at most: more cannot be a person's and mean that the panel restarted."""
_CODES = {"off": "-", "steady": "S", "breathing": "B", "flashing": "F"}
_GREETING = re.compile(r"H(\d\d)([PEBW?])")
_PRESSES = re.compile(r"P([0-9A-F]{4})([0-9A-F]{1,16})")


def encode(body: str) -> bytes:
    """Returns a message: ``$``, the body, ``*``, the body's CRC-16 (XMODEM) as four hexadecimal digits, a
    line feed.

    Args:
        body: printable ASCII without ``$`` and ``*``.
    """
    raw = body.encode("ascii")
    return b"$%s*%04X\n" % (raw, binascii.crc_hqx(raw, 0))


def lamps_body(lamps: Lamps) -> str:
    """Returns the body of a message that sets the lamps: L and a character for each."""
    return "L" + "".join(_CODES[pattern] for pattern in astuple(lamps))


class Decoder:
    """Finds the messages in a stream of bytes: each begins at a ``$``, whatever came before."""

    def __init__(self) -> None:
        self._line: bytearray | None = None

    def feed(self, data: bytes) -> list[str]:
        """Returns the bodies of the messages that end in these bytes and have right checksums."""
        bodies = []
        for byte in data:
            if byte == ord("$"):
                self._line = bytearray()
            elif self._line is None:
                continue
            elif byte == ord("\n"):
                body = _checked(bytes(self._line))
                if body:
                    bodies.append(body)
                self._line = None
            elif len(self._line) < _LONGEST:
                self._line.append(byte)
            else:
                self._line = None
        return bodies


def _checked(line: bytes) -> str:
    """Returns the body of a line with a right checksum, else an empty string."""
    body, _, checksum = line.rpartition(b"*")
    if checksum != b"%04X" % binascii.crc_hqx(body, 0) or not body.isascii():
        return ""
    return body.decode("ascii")


class PanelKeys:
    """Decodes a panel's messages: its greeting and its buttons, ``1``, ``2``, ... for each press.

    The panel sends how often each button was pressed so far, so that the next message makes good a lost one.

    Attributes:
        version: of the protocol that the panel speaks; empty until its greeting was heard.
        cause: why the panel was started, a letter of docs/panel.md, where the last bytes held its greeting.
        heard: how many messages have come.
        counts: a digit for each button, its presses; empty until they were heard.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Resets the state after the port was opened anew: earlier presses are dropped."""
        self._decoder = Decoder()
        self._beat = 0
        self.version, self.cause, self.heard, self.counts = "", "", 0, ""

    def feed(self, data: bytes) -> list[str]:
        """Returns the buttons that were pressed, as these bytes state."""
        keys, self.cause = [], ""
        for body in self._decoder.feed(data):
            self.heard += 1
            if greeting := _GREETING.fullmatch(body):
                self.version, self.cause = greeting[1], greeting[2]
            elif presses := _PRESSES.fullmatch(body):
                keys += self._pressed(int(presses[1], 16), presses[2])
        return keys

    def _pressed(self, beat: int, counts: str) -> list[str]:
        """Returns the presses since the last message; none where this is the first since the panel
        started."""
        beats = (beat - self._beat) % 0x10000
        more = [(int(new, 16) - int(old, 16)) % 16 for new, old in zip(counts, self.counts, strict=False)]
        follows = len(counts) == len(self.counts) and beats <= _MOST_BEATS and max(more) <= _MOST_PRESSES
        self._beat, self.counts = beat, counts
        if not follows:
            return []
        return [str(button) for button, times in enumerate(more, 1) for _ in range(times)]
