"""Converts bytes on a socket to checked messages and back. Malformed bytes are counted and dropped.

On the stream socket, a message consists of a single part: the topic's name, a zero byte, the protocol
version, and the MessagePack payload. On the control socket, it consists of the version and the payload.
Stream messages are encoded as arrays of fields, and requests and replies as maps from names to fields.
Unknown fields are ignored, and fields that were added later have a default. So a newer program may append
fields. Types, lengths and finiteness are checked on receipt. Numbers in ``bytes`` are little-endian.
"""

from __future__ import annotations

import functools
import logging
import re
from collections import Counter
from typing import Any, Union

import msgspec

from enliven.document import Character
from enliven.errors import EnlivenError, InputError
from enliven.files import DECODE_ERRORS
from enliven.wire.characters import CharacterMessage
from enliven.wire.convert_characters import character_to_message, message_to_character
from enliven.wire.requests import REQUESTS, Request
from enliven.wire.topics import BY_TYPE, REPLY, REQUEST, STREAMS, Topic

log = logging.getLogger(__name__)

VERSION = 1
"""Version of the network protocol. It is incremented if an old program could misread a new message."""

_ID_KEY = b"\xa2id"
"""MessagePack bytes of the key "id", which contains the number of a reply."""
_NUMBER_BYTES = {0xCC: 2, 0xCD: 3, 0xCE: 5, 0xCF: 9}
"""Total size in bytes of a MessagePack integer, by its first byte. All other integers take one byte."""

_UNENCODABLE_REASON = "a name or a number in the data cannot be sent"
"""Reason for refusing text with lone surrogates, and integers of more than 64 bits."""

_ENCODER = msgspec.msgpack.Encoder()


class MalformedMessageError(Exception):
    """Raised for bytes that are not a valid message. ``kind`` is the category under which the error is
    counted."""

    def __init__(self, kind: str, why: str) -> None:
        super().__init__(f"{kind}: {why}")
        self.kind, self.why = kind, why


class OtherVersionError(MalformedMessageError):
    """Raised for a message from a program with another protocol version. ``version`` is the sender's
    version."""

    def __init__(self, version: int) -> None:
        super().__init__(
            "version",
            f"the sender uses version {version} of the network protocol, but this program uses "
            f"version {VERSION}",
        )
        self.version = version


def pack_stream(message: Any) -> bytes:
    """Returns the bytes of a stream message to send.

    Raises:
        KeyError: for an object without a topic in the table.
    """
    return pack_topic(BY_TYPE[type(message)].name, _ENCODER.encode(message))


def pack_topic(name: str, payload: bytes) -> bytes:
    """Returns the bytes of a stream message from a topic's name and a payload.

    Use it in programs that forward messages or add their own topics.
    """
    return name.encode() + b"\0" + bytes([VERSION]) + payload


def pack_checked(message: Any) -> bytes:
    """Returns the bytes of a stream message. Checks that a viewer can decode them.

    Raises:
        KeyError: for an object without a topic in the table.
        MalformedMessageError: if viewers would refuse the message.
    """
    topic = BY_TYPE[type(message)]
    try:
        data = pack_stream(message)
    except (OverflowError, ValueError):
        raise MalformedMessageError(topic.name, "the message cannot be encoded") from None
    _decode_checked(topic, data[len(topic.name) + 1 :])
    return data


def check_request(body: Any) -> None:
    """Checks that a request can be encoded and decoded.

    Raises:
        InputError: for a field that is out of its range. The message names the field and the range.
    """
    where = f"request {type(body).__name__}"
    try:
        unpack_control(pack_control(Request(0, body)), REQUEST)
    except MalformedMessageError as error:
        raise InputError(
            _reason_sentence(error.why), where=where, remedy="Use a value in the allowed range."
        ) from None
    except (OverflowError, ValueError):
        raise InputError(_UNENCODABLE_REASON, where=where, remedy="Use another name or number.") from None


def check_character(character: Character) -> None:
    """Checks that a character can be encoded and decoded.

    Raises:
        InputError: for a field that is out of its range. The message names the field and the range.
    """
    message = character_to_message(character, 1)
    where, remedy = f"character {character.id!r}", "Change the value in the project."
    try:
        data = pack_payload(message)
    except (OverflowError, ValueError):
        raise InputError(_UNENCODABLE_REASON, where=where, remedy=remedy) from None
    try:
        message = _create_checking_decoder(CharacterMessage, ()).decode(data)
    except (msgspec.MsgspecError, ValueError) as error:
        raise InputError(_reason_sentence(str(error)), where=where, remedy=remedy) from None
    message_to_character(message)


def _reason_sentence(reason: str) -> str:
    """Converts the decoder's error text to a sentence for users, with the field and its error."""
    problem, _, place = reason.partition(" - at `$")
    field = place.rstrip("`").lstrip(".").removeprefix("body").lstrip(".") or "a value"
    expected = re.fullmatch(r"Expected `[^`]*` (.*)", problem)
    if expected is not None:
        return f"{field} is out of its range ({expected[1]})"
    return f"{field} cannot be sent" if problem.startswith("Expected") else problem


def pack_payload(message: Any) -> bytes:
    """Returns the MessagePack payload of a message without a header, as stored in a recording."""
    return _ENCODER.encode(message)


def pack_recorded(message: Any) -> tuple[str, str, str, str, str, bytes]:
    """Returns the arguments of :meth:`enliven.recording.Recorder.write` for a message, except its time."""
    kind: Any = type(message)
    payload = _ENCODER.encode(message)
    return (
        BY_TYPE[kind].name,
        f"enliven.{kind.__name__}",
        _json_schema(kind),
        "jsonschema",
        "msgpack",
        payload,
    )


@functools.cache
def _json_schema(kind: Any) -> str:
    """Returns the JSON schema of a message class, which recordings contain."""
    return msgspec.json.encode(msgspec.json.schema(kind)).decode()


def unpack_stream(data: bytes) -> tuple[Topic, Any]:
    """Decodes and checks a stream message. Returns its topic and the message.

    Raises:
        MalformedMessageError: for any invalid bytes.
    """
    name, separator, _ = data[:64].partition(b"\0")
    topic = STREAMS.get(name.decode("ascii", "replace"))
    if not separator or topic is None:
        raise MalformedMessageError("unknown topic", repr(bytes(name[:32])))
    return topic, _decode_checked(topic, data[len(name) + 1 :])


def pack_control(message: Any) -> bytes:
    """Returns the bytes of a request or reply to send."""
    return bytes([VERSION]) + _ENCODER.encode(message)


def reply_prefix(number: int) -> bytes:
    """Returns the bytes that precede the payload (:func:`pack_payload`) of an answer. With this function, a
    long answer can be encoded once for all viewers.
    """
    # Encode an empty reply without its last byte. This byte is a nil, and the answer takes its place.
    return bytes([VERSION]) + _ENCODER.encode({"id": number, "body": None})[:-1]


def reply_number(data: bytes) -> int:
    """Returns the number of the request that a reply answers, without decoding the rest of the reply.

    Raises:
        MalformedMessageError: for bytes that do not start like a reply of this version.
    """
    if not data:
        raise MalformedMessageError(REPLY.name, "the message is empty")
    if data[0] != VERSION:
        raise OtherVersionError(data[0])
    # A reply is a short map. Its first key is "id", and an integer of variable length follows.
    number = data[5 : 5 + _NUMBER_BYTES.get(data[5], 1)] if len(data) > 5 else b""
    if not number or data[1] & 0xF0 != 0x80 or data[2:5] != _ID_KEY:
        raise MalformedMessageError(REPLY.name, "the reply has no number")
    try:
        return msgspec.msgpack.decode(number, type=int)
    except DECODE_ERRORS:
        raise MalformedMessageError(REPLY.name, "the number of the reply cannot be read") from None


def unpack_control(data: bytes, topic: Topic) -> Any:
    """Decodes and checks a request or reply.

    Raises:
        MalformedMessageError: for any invalid bytes.
    """
    return _decode_checked(topic, data)


def _decode_checked(topic: Topic, data: bytes) -> Any:
    """Checks the version byte, the size, the types and the lengths of a message, and decodes it."""
    if not data:
        raise MalformedMessageError(topic.name, "the message is empty")
    if data[0] != VERSION:
        raise OtherVersionError(data[0])
    if len(data) - 1 > topic.max_bytes:
        raise MalformedMessageError(
            topic.name, f"the message has {len(data) - 1} bytes, but at most {topic.max_bytes} are allowed"
        )
    try:
        requests = tuple(REQUESTS) if topic is REQUEST else ()
        return _create_checking_decoder(topic.type, requests).decode(memoryview(data)[1:])
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise MalformedMessageError(topic.name, str(error)) from None


@functools.cache
def _create_checking_decoder(kind: Any, bodies: tuple[type[Any], ...]) -> msgspec.msgpack.Decoder[Any]:
    """Returns a decoder of a message class that checks types and ranges.

    ``bodies`` are the classes of the bodies that a request may contain.
    """
    return msgspec.msgpack.Decoder(kind[Union[bodies]] if bodies else kind)  # noqa: UP007


class RejectCounter:
    """A counter of malformed messages by kind. It logs the first message of each kind.

    Args:
        where: name of the socket, for the log.
    """

    def __init__(self, where: str) -> None:
        self.where = where
        self.counts: Counter[str] = Counter()

    @property
    def total(self) -> int:
        """Number of dropped messages."""
        return self.counts.total()

    def add(self, error: MalformedMessageError | EnlivenError | ValueError) -> None:
        """Counts one malformed message."""
        kind = error.kind if isinstance(error, MalformedMessageError) else "refused"
        self.counts[kind] += 1
        if self.counts[kind] == 1:
            log.warning(
                "%s: dropped a malformed message (%s); further messages of this kind are counted, "
                "but not logged",
                self.where,
                error,
            )
