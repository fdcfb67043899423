"""OSC bundles with addresses that are encoded once, and numbers that are filled in for every frame.

python-osc encodes one message in about 20 us of Python. For all messages of a frame this would hold the
interpreter's lock for milliseconds, and delay the edge. Here python-osc encodes each set of addresses once. A
frame then only overwrites the numbers, with one NumPy assignment per bundle.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from pythonosc.osc_bundle_builder import IMMEDIATELY
from pythonosc.osc_message_builder import OscMessageBuilder
from pythonosc.parsing import osc_types

from enliven.arrays import AnyArray, Int

MAX_PACKET_BYTES = 1472
"""Largest UDP payload that fits into one Ethernet frame of 1,500 bytes: without the headers of IP and UDP."""
_MAX_NUMBER = 1e9
"""Limit of the numbers that are sent. It fits into a 32-bit integer, and no position is that far away."""
_MAX_TEMPLATES = 64
"""Maximum number of kept templates. The sets of performers and characters on a stage are few."""


@dataclass(frozen=True)
class OscMessage:
    """The constant part of an OSC message.

    Attributes:
        address: of OSC, such as "/VMC/Ext/Bone/Pos".
        types: OSC type tags of the numbers: "f" for each float, "i" for each integer.
        words: strings before the numbers.
    """

    address: str
    types: str
    words: tuple[str, ...] = ()


class OscTemplate:
    """Messages in bundles of limited size, and the places of their numbers.

    Args:
        messages: in their order. Messages with consecutive numbers stay in this order, also across bundles.
        max_bytes: maximum size of a bundle. A longer single message gets its own bundle.
    """

    def __init__(self, messages: Sequence[OscMessage], max_bytes: int = MAX_PACKET_BYTES) -> None:
        self._bundles: list[_Bundle] = []
        head = b"#bundle\x00" + osc_types.write_date(IMMEDIATELY)
        packet, floats, integers, first, count = bytearray(head), list[int](), list[int](), 0, 0
        for message in messages:
            data = encode_message(message)
            if len(packet) > len(head) and len(packet) + 4 + len(data) > max_bytes:
                self._close(packet, floats, integers, slice(first, count))
                packet, floats, integers, first = bytearray(head), [], [], count
            packet += osc_types.write_int(len(data)) + data
            # The numbers are the last words of a message, and every part of OSC is a multiple of four bytes.
            word = len(packet) // 4 - len(message.types)
            for number, kind in enumerate(message.types):
                (integers if kind == "i" else floats).append(word + number)
            count += len(message.types)
        if len(packet) > len(head):
            self._close(packet, floats, integers, slice(first, count))
        self.count = count

    def _close(self, packet: bytearray, floats: list[int], integers: list[int], numbers: slice) -> None:
        places = np.array(sorted([*floats, *integers]), np.intp)
        self._bundles.append(_Bundle(packet, places, np.flatnonzero(np.isin(places, integers)), numbers))

    def packets(self, numbers: AnyArray) -> list[bytes]:
        """Returns the bundles with these numbers (``count``,), in the order of the messages."""
        return [bundle.filled(numbers) for bundle in self._bundles]


class _Bundle:
    """One encoded bundle.

    Args:
        packet: the encoded bytes.
        places: (N,) where the numbers are, counted in words of four bytes.
        integers: which of the places are integers.
        numbers: the part of a frame's numbers that this bundle contains.
    """

    def __init__(self, packet: bytearray, places: Int, integers: Int, numbers: slice) -> None:
        self._packet, self._places, self._integers, self._numbers = packet, places, integers, numbers
        self._floats, self._whole = np.frombuffer(packet, ">f4"), np.frombuffer(packet, ">i4")

    def filled(self, numbers: AnyArray) -> bytes:
        """Returns the bytes with the numbers of a frame."""
        values = numbers[self._numbers]
        self._floats[self._places] = values
        if len(self._integers):
            self._whole[self._places[self._integers]] = np.rint(values[self._integers]).astype(np.int32)
        return bytes(self._packet)


class OscTemplates:
    """The templates of one output, by the set of addresses of a frame."""

    def __init__(self) -> None:
        self._templates: dict[Hashable, OscTemplate] = {}

    def packets(
        self, key: Hashable, messages: Callable[[], Sequence[OscMessage]], numbers: Sequence[AnyArray]
    ) -> list[bytes]:
        """Returns the bundles of a frame.

        Args:
            key: identifies the messages. Equal keys have equal messages.
            messages: returns the messages in their order. It is called for a new key only.
            numbers: arrays that together contain the messages' numbers in the same order.
        """
        template = self._templates.get(key)
        if template is None:
            if len(self._templates) >= _MAX_TEMPLATES:
                self._templates.clear()
            template = self._templates[key] = OscTemplate(messages())
        flat = np.concatenate([np.ravel(part) for part in numbers])
        # A receiver cannot use a value that is not finite, and some receivers crash.
        flat = np.nan_to_num(flat, posinf=0.0, neginf=0.0)
        return template.packets(np.clip(flat, -_MAX_NUMBER, _MAX_NUMBER))


def encode_message(message: OscMessage) -> bytes:
    """Returns a message with zeros for its numbers, encoded by python-osc."""
    builder = OscMessageBuilder(address=message.address)
    for word in message.words:
        builder.add_arg(word, OscMessageBuilder.ARG_TYPE_STRING)
    for kind in message.types:
        builder.add_arg(0 if kind == "i" else 0.0, kind)
    return builder.build().dgram
