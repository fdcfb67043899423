"""Client side of the CURVE handshake, written at byte level, and key pairs for an edge, a viewer and a
stranger.
"""

from __future__ import annotations

import struct

from nacl import bindings as sodium

from enliven.keys.key_files import KeyPair

EDGE, VIEWER, STRANGER = (KeyPair(*sodium.crypto_box_seed_keypair(bytes([k]) * 32)) for k in range(3))


class Client:
    """The client side of a CURVE connection, as in the specification.

    ``plain`` replaces the content of a command before encryption, so that tests can send arbitrary content.
    """

    def __init__(self, keys: KeyPair = VIEWER, edge: bytes = EDGE.public) -> None:
        self.keys, self.edge = keys, edge
        self.public, self.secret = sodium.crypto_box_keypair()
        self.count = 0

    def next(self) -> bytes:
        self.count += 1
        return struct.pack(">Q", self.count)

    def hello(self, plain: bytes = bytes(64)) -> bytes:
        count = self.next()
        box = sodium.crypto_box(plain, b"CurveZMQHELLO---" + count, self.edge, self.secret)
        return b"\x05HELLO\x01\x00" + bytes(72) + self.public + count + box

    def vouch(self, welcome: bytes, vouched: bytes = b"") -> bytes:
        """Returns the VOUCH box, which proves that this client has the secret key of its public key."""
        once, _ = self._open_welcome(welcome)
        proof = (vouched or self.public) + self.edge
        return sodium.crypto_box(proof, b"VOUCH---" + bytes(16), once, self.keys.secret)

    def initiate(self, welcome: bytes, vouched: bytes = b"", plain: bytes = b"") -> bytes:
        once, cookie = self._open_welcome(welcome)
        self.shared = sodium.crypto_box_beforenm(once, self.secret)
        vouch = self.vouch(welcome, vouched)
        plain = plain or self.keys.public + bytes(16) + vouch + b"\x0bSocket-Type\0\0\0\x06DEALER"
        count = self.next()
        box = sodium.crypto_box_afternm(plain, b"CurveZMQINITIATE" + count, self.shared)
        return b"\x08INITIATE" + cookie + count + box

    def _open_welcome(self, welcome: bytes) -> tuple[bytes, bytes]:
        """Returns the edge's key of this connection, and its cookie."""
        nonce, box = welcome[8:24], welcome[24:]
        opened = sodium.crypto_box_open(box, b"WELCOME-" + nonce, self.edge, self.secret)
        return opened[:32], opened[32:]

    def message(self, data: bytes, flags: int = 0) -> bytes:
        count = self.next()
        box = sodium.crypto_box_afternm(bytes([flags]) + data, b"CurveZMQMESSAGEC" + count, self.shared)
        return b"\x07MESSAGE" + count + box

    def decrypt(self, sealed: bytes) -> bytes:
        return sodium.crypto_box_open_afternm(sealed[16:], b"CurveZMQMESSAGES" + sealed[8:16], self.shared)
