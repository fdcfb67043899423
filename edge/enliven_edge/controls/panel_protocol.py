"""The patterns of a control's lamps, and the messages between edge and button panel, as in docs/panel.md."""

from __future__ import annotations

import binascii
import re
from dataclasses import astuple, dataclass
from typing import Literal

from enliven.health import Severity

Pattern = Literal["off", "steady", "breathing", "flashing"]


@dataclass(frozen=True)
class Lamps:
    """One pattern per lamp.

    Attributes:
        attract: fades in and out while the stage waits for a performer.
        possess: fades in and out while a performer may possess a character, and is steady during a
            possession.
        locked: is steady while the cast is locked.
        fault: is steady while tracking is impaired, and flashes while it fails.
    """

    attract: Pattern = "off"
    possess: Pattern = "off"
    locked: Pattern = "off"
    fault: Pattern = "off"


def lamps_from_state(
    *, is_performer_present: bool, is_character_held: bool, locked: bool, highest_severity: int
) -> Lamps:
    """Returns the patterns that show a state of the stage.

    Args:
        is_performer_present: True if a performer is in view.
        is_character_held: True if a performer possesses a character.
        locked: True if the cast is locked.
        highest_severity: the highest :class:`enliven.health.Severity` of the current problems.
    """
    return Lamps(
        attract="off" if is_performer_present or is_character_held else "breathing",
        possess="steady" if is_character_held else "breathing" if is_performer_present else "off",
        locked="steady" if locked else "off",
        fault="flashing"
        if highest_severity >= Severity.ERROR
        else "steady"
        if highest_severity >= Severity.WARNING
        else "off",
    )


VERSION = "01"
"""The version of the protocol of this edge, as two digits of the panel's greeting."""
GREETING_REQUEST = "?"
"""The body of a message that requests the panel's greeting."""
_MAX_BODY_BYTES = 64
"""Maximum bytes of a body and its checksum. Longer data is noise. The panel's longest message has 19
bytes."""
_MAX_MISSED_HEARTBEATS = 12
"""The panel sends four heartbeats per second. If more than this number is missing, the panel has restarted or
the connection was interrupted."""
_MAX_PRESSES = 7
"""Maximum number of presses between two messages. People cannot press more often, so the panel restarted."""
_CODES = {"off": "-", "steady": "S", "breathing": "B", "flashing": "F"}
_GREETING = re.compile(r"H(\d\d)([PEBW?])")
_PRESSES = re.compile(r"P([0-9A-F]{4})([0-9A-F]{1,16})")


def encode(body: str) -> bytes:
    """Returns a message: ``$``, the body, ``*``, its CRC-16 (XMODEM) as four hexadecimal digits, a line feed.

    Args:
        body: printable ASCII without ``$`` and ``*``.
    """
    raw = body.encode("ascii")
    return b"$%s*%04X\n" % (raw, binascii.crc_hqx(raw, 0))


_PRINTABLE = re.compile(rb"[\x20-\x7e]*")
"""The characters of a body: printable ASCII."""


def lamps_message_body(lamps: Lamps) -> str:
    """Returns the body of a message that sets the lamps: L and one pattern character for each lamp."""
    return "L" + "".join(_CODES[pattern] for pattern in astuple(lamps))


_MESSAGE_BOUNDARIES = re.compile(rb"([$\n])")
"""The bytes that begin and end a message. A split with this pattern returns them, too."""


class Decoder:
    """Finds the messages in a stream of bytes. Each starts at a ``$``, whatever precedes it."""

    def __init__(self) -> None:
        self._line: bytes | None = None

    def feed(self, data: bytes) -> list[str]:
        """Returns the bodies of the messages that end in these bytes and have valid checksums."""
        bodies = []
        for piece in _MESSAGE_BOUNDARIES.split(data):
            if piece == b"$":
                self._line = b""
            elif self._line is None:
                continue
            elif piece == b"\n":
                body = _verify_checksum(self._line)
                if body:
                    bodies.append(body)
                self._line = None
            else:
                line = self._line + piece
                self._line = line if len(line) <= _MAX_BODY_BYTES else None
        return bodies


def _verify_checksum(line: bytes) -> str:
    """Returns the body of a line with a valid checksum, else an empty string."""
    body, _, checksum = line.rpartition(b"*")
    # The checksum starts at 0, so it does not change with zero bytes before the body.
    if checksum != b"%04X" % binascii.crc_hqx(body, 0) or not _PRINTABLE.fullmatch(body):
        return ""
    return body.decode("ascii")


class PanelKeys:
    """Decodes a panel's messages: its greeting and its buttons, ``1``, ``2``, ... for each press.

    The panel sends the press count of each button. So a message also reports the presses of lost earlier
    messages.

    Attributes:
        version: protocol version of the panel; empty until its greeting was received.
        cause: a letter that tells why the panel was started (see docs/panel.md), if the last bytes contained
            its greeting.
        received: number of received messages.
        counts: the press count of each button, one digit per button; empty until they were received.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Resets the state after the port was opened again: earlier presses are dropped."""
        self._decoder = Decoder()
        self._beat = 0
        self.version, self.cause, self.received, self.counts = "", "", 0, ""

    def feed(self, data: bytes) -> list[str]:
        """Returns the buttons that were pressed according to these bytes."""
        keys, self.cause = [], ""
        for body in self._decoder.feed(data):
            self.received += 1
            if greeting := _GREETING.fullmatch(body):
                self.version, self.cause = greeting[1], greeting[2]
            elif presses := _PRESSES.fullmatch(body):
                keys += self._find_new_presses(int(presses[1], 16), presses[2])
        return keys

    def _find_new_presses(self, beat: int, counts: str) -> list[str]:
        """Returns the presses since the last message.

        Returns an empty list for the first message after a start of the panel.
        """
        heartbeats = (beat - self._beat) % 0x10000
        missed = [
            (int(new_count, 16) - int(old_count, 16)) % 16
            for new_count, old_count in zip(counts, self.counts, strict=False)
        ]
        is_continuous = (
            len(counts) == len(self.counts)
            and heartbeats <= _MAX_MISSED_HEARTBEATS
            and max(missed) <= _MAX_PRESSES
        )
        self._beat, self.counts = beat, counts
        if not is_continuous:
            return []
        return [str(button) for button, repeat in enumerate(missed, 1) for _ in range(repeat)]
