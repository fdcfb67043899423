"""Reads OSC packets with the standard library alone."""

import struct

_BUNDLE_START = b"#bundle\0"
_MAX_DEPTH = 8
"""Maximum number of bundles in each other."""
_NUMBERS = {"f": ">f", "i": ">i", "d": ">d", "h": ">q"}


def read_packet(data, depth=0):
    """Returns the messages of a packet as (address, arguments), also those in bundles.

    Raises:
        ValueError: for a packet that is not OSC.
    """
    if not data.startswith(_BUNDLE_START):
        return [_read_message(data)]
    if depth >= _MAX_DEPTH or len(data) < 16:
        raise ValueError("a bundle that is too short, or nested too deep")
    messages, at = [], 16
    while at < len(data):
        if at + 4 > len(data):
            raise ValueError("an element without a size")
        (size,) = struct.unpack_from(">i", data, at)
        at += 4
        if size < 0 or at + size > len(data):
            raise ValueError("an element that does not fit in its bundle")
        messages += read_packet(data[at : at + size], depth + 1)
        at += size
    return messages


def _read_message(data):
    if not data.startswith(b"/"):
        raise ValueError("neither a message nor a bundle")
    address, at = _read_text(data, 0)
    if at >= len(data):
        return address, []
    types, at = _read_text(data, at)
    if not types.startswith(","):
        raise ValueError("a message without types")
    arguments = []
    for kind in types[1:]:
        if kind in _NUMBERS:
            size = struct.calcsize(_NUMBERS[kind])
            if at + size > len(data):
                raise ValueError("a message that is cut off")
            arguments.append(struct.unpack_from(_NUMBERS[kind], data, at)[0])
            at += size
        elif kind == "s":
            text, at = _read_text(data, at)
            arguments.append(text)
        elif kind in "TF":
            arguments.append(kind == "T")
        else:
            raise ValueError("an argument of type " + kind)
    return address, arguments


def _read_text(data, at):
    """Returns a text that ends with zeros, and the place after it."""
    end = data.find(b"\0", at)
    if end < 0:
        raise ValueError("a text without an end")
    return data[at:end].decode("utf-8", "replace"), end + 4 - (end - at) % 4
