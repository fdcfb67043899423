"""Reads the messages of a recording that an edge published."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import msgspec

from enliven.errors import EnlivenError
from enliven.files import DAMAGE
from enliven.recording import Recording


def read_messages(
    recording: Recording, topic: str, kind: type[Any], convert: Callable[[Any], Any] = lambda message: message
) -> Iterator[Any]:
    """Yields the messages of a topic, decoded as ``kind`` and converted. Unreadable messages are skipped."""
    if topic not in recording.info.topics:
        return
    for _, data in recording.messages(topic):
        try:
            value = convert(msgspec.msgpack.decode(data, type=kind))
        except (msgspec.MsgspecError, EnlivenError, *DAMAGE):
            continue
        yield value
