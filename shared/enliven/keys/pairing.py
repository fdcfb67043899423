"""Pairs a viewer with an edge by a six-digit code: SPAKE2, then an exchange of encrypted public keys.

The code is far too short to be an encryption key: an attacker could record an exchange that is encrypted by
the code itself, and then try all codes. SPAKE2 (RFC 9382, in the implementation of Magic Wormhole) derives a
strong key of 256 bits from the code. In each exchange, an attacker can test exactly one code. A recorded
exchange does not allow testing any code:

1. viewer -> edge: its SPAKE2 message
2. edge -> viewer: the edge's SPAKE2 message
3. viewer -> edge: its public key, name and role, in a box (encrypted with the agreed key)
4. edge -> viewer: the edge's public key, name and the granted role, in a box (encrypted with the agreed key)

Only a side that knew the code can decrypt a box. The edge sends its box only after it has decrypted the
viewer's box. It allows few exchanges per code.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import msgspec

from enliven.keys.key_files import KEY_BYTES, clean_name
from enliven.keys.roles import ROLES, Role, role_includes

CODE_DIGITS = 6
"""Number of digits of a code."""
CODE_LIFETIME_S = 300.0
"""Time in seconds until a code expires. It is long enough to walk to the viewer's computer and enter the
code."""
MAX_TRIES_PER_CODE = 3
"""Maximum number of exchanges with one code. It allows for one or two typing errors."""
FIRST_PAUSE_S = 30.0
"""Pause in seconds after too many tries. During it, a code is not shown. The pause doubles with each further
code that is used up."""
MAX_PAUSE_S = 900.0
"""Maximum pause in seconds after too many tries. With it, an attacker has 288 guesses per day, and a chance
of 1 in 3,500 to guess a code.
"""
MESSAGE_BYTES = 33
"""Size in bytes of a SPAKE2 message: one byte for the side, and a point on Ed25519."""

_VIEWER, _EDGE = b"enliven viewer", b"enliven edge"
_WRONG_CODE = {
    _VIEWER: "the pairing code is wrong",
    _EDGE: "the pairing code is wrong, or another program answers instead of the edge",
}
"""The reason why an encrypted introduction (a box) cannot be decrypted, by the sender of the box."""
_KEY_LABELS = {_VIEWER: b"enliven pairing: viewer to edge", _EDGE: b"enliven pairing: edge to viewer"}


class PairingError(Exception):
    """Raised if a pairing is refused. The message contains the reason for the user."""


@dataclass(frozen=True)
class Introduction:
    """The content of a box (an encrypted introduction): a public key, the name of its owner, and the
    requested or the granted role.
    """

    public: bytes
    name: str
    role: Role


class ViewerPairing:
    """The viewer's side of one pairing.

    Args:
        code: the code that the edge shows. Spaces and dashes in it are ignored.

    Attributes:
        message: the SPAKE2 message for the edge.

    Raises:
        PairingError: if the code does not have six digits.
    """

    def __init__(self, code: str) -> None:
        from spake2 import SPAKE2_A

        digits = "".join(c for c in code if c not in " -")
        if len(digits) != CODE_DIGITS or not (digits.isascii() and digits.isdecimal()):
            raise PairingError(f"a pairing code must have {CODE_DIGITS} digits")
        self._spake = SPAKE2_A(digits.encode(), idA=_VIEWER, idB=_EDGE)
        self.message: bytes = self._spake.start()
        self._key = b""

    def encrypt_introduction(self, answer: bytes, introduction: Introduction) -> bytes:
        """Returns the box with the viewer's introduction, after the edge's SPAKE2 message.

        Raises:
            PairingError: if the edge's SPAKE2 message is invalid.
        """
        self._key = _agree_on_key(self._spake, answer)
        return _encrypt_box(self._key, _VIEWER, introduction)

    def decrypt_introduction(self, box: bytes) -> Introduction:
        """Returns the edge's introduction.

        Raises:
            PairingError: if the sender of the box did not know the code.
        """
        return _decrypt_box(self._key, _EDGE, box)


class EdgePairing:
    """The edge's side of one pairing. Create it by :meth:`PairingDesk.start_pairing`."""

    def __init__(self, code: str, message: bytes) -> None:
        from spake2 import SPAKE2_B

        spake = SPAKE2_B(code.encode(), idA=_VIEWER, idB=_EDGE)
        self.message: bytes = spake.start()
        self._key = _agree_on_key(spake, message)

    def decrypt_introduction(self, box: bytes) -> Introduction:
        """Returns the viewer's introduction.

        Raises:
            PairingError: if the viewer did not know the code.
        """
        return _decrypt_box(self._key, _VIEWER, box)

    def encrypt_introduction(self, introduction: Introduction) -> bytes:
        """Returns the box with the edge's introduction."""
        return _encrypt_box(self._key, _EDGE, introduction)


class PairingCodes:
    """Manages the pairing code of an edge. A code expires and allows few tries. After too many tries, a new
    code follows after a pause.

    Args:
        show_code: a function that is called with each new code.
        clock: a function that returns the time in seconds. Tests replace it.
    """

    def __init__(
        self,
        show_code: Callable[[str], None] = lambda code: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._show, self._clock = show_code, clock
        self._code = ""
        self._tries = self._used_up = 0
        self._until = self._expires = self._paused_until = 0.0

    def open_for(self, seconds: float) -> None:
        """Accepts pairings for some seconds from now. A pause after too many tries is not shortened."""
        self._until = max(self._until, self._clock() + seconds)
        self.poll()

    @property
    def code(self) -> str:
        """The code to show. It is empty while pairing is closed or paused."""
        self.poll()
        return self._code

    @property
    def seconds_left(self) -> int:
        """Seconds until the shown code expires, or 0 if no code is shown."""
        return max(0, round(self._expires - self._clock())) if self.code else 0

    @property
    def pause_s(self) -> float:
        """Remaining seconds of the pause after too many tries, or 0 without a pause."""
        return max(0.0, self._paused_until - self._clock())

    def poll(self) -> None:
        """Removes an expired code. Shows a new code if pairing is open."""
        now = self._clock()
        if self._code and now >= self._expires:
            self._code = ""
        if not self._code and now < self._until and now >= self._paused_until:
            self._code = "".join(str(secrets.randbelow(10)) for _ in range(CODE_DIGITS))
            self._tries, self._expires = 0, min(now + CODE_LIFETIME_S, self._until)
            self._show(self._code)

    def start_pairing(self, message: bytes) -> EdgePairing:
        """Begins an exchange with the current code. Each exchange counts as a try, even if it is not
        finished.

        Raises:
            PairingError: if no code is shown, or the message is invalid.
        """
        code = self.code
        if not code:
            raise PairingError(self._describe_closed())
        self._tries += 1
        if self._tries >= MAX_TRIES_PER_CODE:
            # This exchange may still succeed. Later exchanges need a new code.
            self._code = ""
            pause = min(FIRST_PAUSE_S * 2**self._used_up, MAX_PAUSE_S)
            self._used_up = min(self._used_up + 1, 16)
            self._paused_until = self._clock() + pause
        return EdgePairing(code, message)

    def finish_pairing(self) -> None:
        """Invalidates the code after a successful pairing. The next code is shown immediately."""
        self._code, self._used_up, self._paused_until = "", 0, 0.0
        self.poll()

    def _describe_closed(self) -> str:
        if self.pause_s and self._clock() < self._until:
            return f"too many tries: the edge shows a new code in {self.pause_s:.0f} s"
        return (
            "pairing is closed. Start the edge again, or open pairing on the edge's computer: "
            "enliven pair 127.0.0.1 --show-code"
        )


def limit_role(role: Role, highest: Role) -> Role:
    """Returns the lower of two roles."""
    return role if role_includes(highest, role) else highest


def _agree_on_key(spake: Any, message: bytes) -> bytes:
    """Computes the key that both sides agree on. With a wrong code, the key differs, but there is no
    error."""
    try:
        key: bytes = spake.finish(message)
    except Exception:  # The library raises plain Exceptions for invalid bytes.
        raise PairingError("the pairing message is not valid") from None
    return key


def _encrypt_box(key: bytes, sender: bytes, introduction: Introduction) -> bytes:
    from nacl.secret import SecretBox

    data = msgspec.msgpack.encode((introduction.public, clean_name(introduction.name), introduction.role))
    return bytes(SecretBox(_side_key(key, sender)).encrypt(data))


def _decrypt_box(key: bytes, sender: bytes, box: bytes) -> Introduction:
    from nacl.exceptions import CryptoError
    from nacl.secret import SecretBox

    try:
        data = SecretBox(_side_key(key, sender)).decrypt(box)
        public, name, role = msgspec.msgpack.decode(data, type=tuple[bytes, str, str])
    except (CryptoError, ValueError, TypeError, msgspec.MsgspecError):
        raise PairingError(_WRONG_CODE[sender]) from None
    if len(public) != KEY_BYTES or role not in ROLES:
        raise PairingError("the key or the role in the pairing message is not valid")
    return Introduction(public, clean_name(name), role)  # type: ignore[arg-type]


def _side_key(key: bytes, sender: bytes) -> bytes:
    """Derives the encryption key of one direction. The keys differ, so that a box cannot be sent back to its
    sender."""
    return hmac.new(key, _KEY_LABELS[sender], hashlib.sha256).digest()
