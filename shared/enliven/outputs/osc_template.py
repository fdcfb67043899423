"""OSC bundles with addresses that are encoded once. In each frame, only the numbers are written.

python-osc encodes one message in about 20 us of Python. For all messages of a frame this would hold Python's
global lock for milliseconds, and delay the edge. Here python-osc encodes each set of addresses once. In each
frame, one NumPy assignment overwrites the numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from pythonosc.osc_bundle_builder import IMMEDIATELY
from pythonosc.osc_message_builder import OscMessageBuilder
from pythonosc.parsing import osc_types

from enliven.arrays import AnyArray

MAX_PACKET_BYTES = 1472
"""Largest UDP payload that fits into one Ethernet frame of 1,500 bytes: without the headers of IP and UDP."""
_MAX_NUMBER = 1e9
"""Limit of the absolute values that are sent. It fits into a 32-bit integer, and no position is that far from
the origin."""
_MAX_TEMPLATES = 64
"""Maximum number of cached templates. It is enough, because few sets of performers and characters occur on a
stage."""


@dataclass(frozen=True)
class OscMessage:
    """The constant part of an OSC message.

    Attributes:
        address: OSC address, such as "/VMC/Ext/Bone/Pos".
        types: OSC type tags of the numbers, "f" for each float and "i" for each integer.
        words: strings before the numbers.
    """

    address: str
    types: str
    words: tuple[str, ...] = ()


class OscTemplate:
    """Encoded messages in bundles of limited size, and the positions of their numbers.

    Args:
        messages: the messages in the order in which they are sent.
        max_bytes: maximum size of a bundle. A longer single message gets its own bundle.

    Attributes:
        count: how many numbers the messages contain.
    """

    def __init__(self, messages: Sequence[OscMessage], max_bytes: int = MAX_PACKET_BYTES) -> None:
        head = b"#bundle\x00" + osc_types.write_date(IMMEDIATELY)
        data, begins, kinds, places = bytearray(), [0], "", list[int]()
        for message in messages:
            encoded = encode_message(message)
            size = len(data) - begins[-1]
            if size and size + 4 + len(encoded) > max_bytes:
                begins.append(len(data))
                size = 0
            data += (b"" if size else head) + osc_types.write_int(len(encoded)) + encoded
            # The numbers are at the end of a message, and the size of each OSC element is a multiple of four
            # bytes.
            word = len(data) // 4 - len(message.types)
            places += range(word, word + len(message.types))
            kinds += message.types
        self.count = len(places)
        self._data, self._places = data, np.array(places, np.intp)
        self._bundles = [slice(*pair) for pair in pairwise([*begins, len(data)]) if pair[0] < pair[1]]
        self._integers = np.array([n for n, kind in enumerate(kinds) if kind == "i"], np.intp)
        self._floats, self._whole = np.frombuffer(data, ">f4"), np.frombuffer(data, ">i4")

    def packets(self, numbers: AnyArray) -> list[bytes]:
        """Returns the bundles with ``numbers`` (``count``,), in the order of the messages."""
        self._floats[self._places] = numbers
        if len(self._integers):
            whole = np.rint(numbers[self._integers]).astype(np.int32)
            self._whole[self._places[self._integers]] = whole
        return [bytes(self._data[bundle]) for bundle in self._bundles]


class OscTemplates:
    """A cache of the templates of one output. The key describes the set of addresses in a frame."""

    def __init__(self) -> None:
        self._templates: dict[Hashable, OscTemplate] = {}

    def packets(
        self, key: Hashable, messages: Callable[[], Sequence[OscMessage]], numbers: AnyArray
    ) -> list[bytes]:
        """Returns the bundles of a frame.

        Args:
            key: identifies the messages. Equal keys must mean equal messages.
            messages: a function that returns the messages in order. It is called only for a new key.
            numbers: the numbers of all messages, in the order of the messages.
        """
        template = self._templates.get(key)
        if template is None:
            if len(self._templates) >= _MAX_TEMPLATES:
                self._templates.clear()
            template = self._templates[key] = OscTemplate(messages())
        return template.packets(_limit_value(numbers))


def _limit_value(numbers: AnyArray) -> AnyArray:
    """Clamps numbers to the range that is sent. Numbers that are not finite become 0.

    A receiver cannot use a value that is not finite, and some receivers crash.
    """
    # A comparison with NaN is false.
    if not len(numbers) or (numbers.max() <= _MAX_NUMBER and numbers.min() >= -_MAX_NUMBER):
        return numbers
    return np.clip(np.nan_to_num(numbers, posinf=0.0, neginf=0.0), -_MAX_NUMBER, _MAX_NUMBER)


def encode_message(message: OscMessage) -> bytes:
    """Returns the bytes of a message, encoded by python-osc, with 0 for each number."""
    builder = OscMessageBuilder(address=message.address)
    for word in message.words:
        builder.add_arg(word, OscMessageBuilder.ARG_TYPE_STRING)
    for kind in message.types:
        builder.add_arg(0 if kind == "i" else 0.0, kind)
    return builder.build().dgram
