"""The server side of CurveZMQ (https://rfc.zeromq.org/spec/26). It converts bytes to bytes, without I/O.

Viewers use libzmq for the protocol. The edge cannot use it, since its sockets are not libzmq sockets (see
:mod:`enliven.wire.zmtp`). All cryptography is from libsodium through PyNaCl: X25519 for the keys of a
connection, XSalsa20-Poly1305 for its messages.
"""

from __future__ import annotations

import hmac
import secrets
import struct
from collections.abc import Callable
from dataclasses import dataclass

from nacl import bindings as sodium
from nacl.exceptions import CryptoError

from enliven.keys.key_files import KEY_BYTES, KeyPair

COMMAND_FLAG = 2
"""Flag inside an encrypted message that contains a protocol command. The flag 1 means that more parts
follow."""
OVERHEAD_BYTES = 33
"""Number of bytes that encryption adds to a message: name, nonce, authenticator and flags."""
UNKNOWN_VIEWER_STATUS = b"400"
"""Status in the ERROR command for a viewer that is not paired. libzmq reports it to the viewer."""
OTHER_EDGE_KEY_STATUS = b"500"
"""Status in the ERROR command for a viewer that expects another key of this edge."""

_HELLO, _INITIATE, _MESSAGE = b"\x05HELLO", b"\x08INITIATE", b"\x07MESSAGE"
_HELLO_BYTES = 200
"""Size in bytes of the command HELLO. It is padded, so that the edge's answer is never longer than the
request."""
_COOKIE_BYTES = 96
"""Size in bytes of the cookie that WELCOME contains and INITIATE returns."""
_SHORT_NONCE_BYTES = 8
"""Size in bytes of a counter nonce. It follows a prefix of 16 bytes, which depends on command and side."""
_LONG_NONCE_BYTES = 16
"""Size in bytes of a random nonce. It follows a prefix of 8 bytes."""
_VOUCH_BYTES = _LONG_NONCE_BYTES + 80
_MIN_INITIATE_BYTES = 9 + _COOKIE_BYTES + _SHORT_NONCE_BYTES + 16 + KEY_BYTES + _VOUCH_BYTES
_MAX_COUNT = 2**64 - 1
"""Maximum message count. A connection ends when it is reached, because counts must never repeat."""


class CurveError(Exception):
    """Raised for an invalid handshake or message. ``status`` is sent to the viewer if it is not empty."""

    def __init__(self, why: str, status: bytes = b"") -> None:
        super().__init__(why)
        self.status = status


@dataclass(frozen=True)
class CurveServer:
    """The long-term keys of an edge, and the check of viewers.

    Attributes:
        keys: the edge's key pair.
        admits: a function that returns True if the viewer with a given public key may connect.
    """

    keys: KeyPair
    admits: Callable[[bytes], bool]


class CurveChannel:
    """The encrypted channel of one connection: first its handshake, then its messages.

    Each connection has its own short-term keys, which both sides discard at its end. So recorded traffic
    cannot be decrypted, even if a long-term key is stolen later (forward secrecy).

    Attributes:
        client: the viewer's public key, after the viewer has proven that it has the secret key. None before.
    """

    def __init__(self, server: CurveServer) -> None:
        self._server = server
        self.client: bytes | None = None
        self._shared = self._cookie = self._client_once = b""
        self._secret_once = self._public_once = b""
        self._received = self._sent = 0

    @property
    def is_ready(self) -> bool:
        """True once the handshake is complete."""
        return self.client is not None

    def answer(self, data: bytes, metadata: bytes) -> bytes:
        """Handles a command of the handshake and returns the command to send back.

        Args:
            metadata: the metadata of this side of the connection, for the command READY.

        Raises:
            CurveError: if the command is invalid, or the viewer may not connect.
        """
        try:
            if not self._cookie and data.startswith(_HELLO):
                return self._answer_hello(data)
            if self._cookie and data.startswith(_INITIATE):
                return self._answer_initiate(data, metadata)
        except CryptoError:
            raise CurveError("an encrypted part of the handshake cannot be decrypted") from None
        raise CurveError("the peer sent an unexpected command in the handshake")

    def _answer_hello(self, data: bytes) -> bytes:
        """Answers HELLO, which contains the viewer's short-term key, with the edge's short-term key."""
        if len(data) != _HELLO_BYTES or data[6:8] != b"\x01\x00":
            raise CurveError("the HELLO command is malformed")
        client_once, count = data[80:112], data[112:120]
        self._check_count(count)
        secret = self._server.keys.secret
        try:
            zeros = sodium.crypto_box_open(data[120:], b"CurveZMQHELLO---" + count, client_once, secret)
        except CryptoError:
            raise CurveError("the viewer expects another key of this edge", OTHER_EDGE_KEY_STATUS) from None
        if zeros != bytes(64):
            raise CurveError("the HELLO command is malformed")
        self._client_once = client_once
        self._public_once, self._secret_once = sodium.crypto_box_keypair()
        # In the specification, the cookie contains the encrypted state, so that a server need not store it.
        # Here the connection stores the state, so a random cookie is enough.
        self._cookie, nonce = secrets.token_bytes(_COOKIE_BYTES), secrets.token_bytes(_LONG_NONCE_BYTES)
        plain = self._public_once + self._cookie
        return b"\x07WELCOME" + nonce + sodium.crypto_box(plain, b"WELCOME-" + nonce, client_once, secret)

    def _answer_initiate(self, data: bytes, metadata: bytes) -> bytes:
        """Answers INITIATE, which proves that the viewer has the secret key for its public key."""
        if len(data) < _MIN_INITIATE_BYTES:
            raise CurveError("the INITIATE command is malformed")
        if not hmac.compare_digest(data[9 : 9 + _COOKIE_BYTES], self._cookie):
            raise CurveError("the handshake's cookie does not match")
        vouch_box = data[9 + _COOKIE_BYTES :]
        count, box = vouch_box[:_SHORT_NONCE_BYTES], vouch_box[_SHORT_NONCE_BYTES:]
        self._check_count(count)
        shared_key = sodium.crypto_box_beforenm(self._client_once, self._secret_once)
        plain = sodium.crypto_box_open_afternm(box, b"CurveZMQINITIATE" + count, shared_key)
        client, nonce = plain[:KEY_BYTES], plain[KEY_BYTES : KEY_BYTES + _LONG_NONCE_BYTES]
        vouch = plain[KEY_BYTES + _LONG_NONCE_BYTES : KEY_BYTES + _VOUCH_BYTES]
        proof = sodium.crypto_box_open(vouch, b"VOUCH---" + nonce, client, self._secret_once)
        if not hmac.compare_digest(proof, self._client_once + self._server.keys.public):
            raise CurveError("the viewer's proof of its key (vouch) belongs to another connection")
        if not self._server.admits(client):
            raise CurveError("the viewer is not paired", UNKNOWN_VIEWER_STATUS)
        self.client, self._shared = client, shared_key
        count = struct.pack(">Q", self.reserve_count())
        return b"\x05READY" + count + self._encrypt(metadata, b"CurveZMQREADY---" + count)

    def reserve_count(self) -> int:
        """Reserves the count of the next message to send. Messages must be sent in the order of their
        counts."""
        self._sent += 1
        return self._sent

    def encrypt(self, data: bytes, flags: int = 0, count: int = 0) -> bytes:
        """Encrypts a message. May be called on another thread if ``count`` is given.

        Args:
            flags: 1 if more parts follow, :data:`COMMAND_FLAG` for a command.
            count: the message's count from :meth:`reserve_count`. 0 means the next count.
        """
        number = struct.pack(">Q", count or self.reserve_count())
        plain = b"".join((bytes([flags]), data))
        return b"".join((_MESSAGE, number, self._encrypt(plain, b"CurveZMQMESSAGES" + number)))

    def decrypt(self, data: bytes) -> tuple[int, bytes]:
        """Decrypts a received message. Returns its flags and its content.

        Raises:
            CurveError: if the message was changed, repeated or reordered, or is not a message.
        """
        if not data.startswith(_MESSAGE) or len(data) < OVERHEAD_BYTES:
            raise CurveError("the message is not encrypted")
        count = data[8:16]
        self._check_count(count)
        try:
            plain = sodium.crypto_box_open_afternm(data[16:], b"CurveZMQMESSAGEC" + count, self._shared)
        except CryptoError:
            raise CurveError("a message was changed in transit") from None
        return plain[0], plain[1:]

    def _encrypt(self, plain: bytes, nonce: bytes) -> bytes:
        return sodium.crypto_box_afternm(plain, nonce, self._shared)

    def _check_count(self, count: bytes) -> None:
        """Raises CurveError unless a received count is higher than all earlier counts. A repeated message is
        an attack.
        """
        (number,) = struct.unpack(">Q", count)
        if not self._received < number < _MAX_COUNT:
            raise CurveError("a message was received twice")
        self._received = number
