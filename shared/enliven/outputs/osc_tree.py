"""OSC output for lights, sound and visuals. Sends joints, confidence, contacts, characters and events below
``/enliven``.

Positions are metres in enliven's world frame: right-handed, +Y up, floor at y = 0. docs/live-outputs.md lists
the addresses.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

import numpy as np

from enliven.arrays import AnyArray, Int
from enliven.errors import InputError
from enliven.outputs.live_frame import LiveEvent, LiveFrame, StageRows
from enliven.outputs.osc_template import OscMessage, OscTemplate, OscTemplates
from enliven.outputs.output import LiveOutput
from enliven.person import Body, Joint
from enliven.settings import load_settings, setting

PORT = 10000
"""Default port. It is the default of TouchDesigner's OSC In operators."""
ROOT = "/enliven"
"""First part of every OSC address."""
_PLAIN = "".join(sorted(set(map(chr, range(0x21, 0x7F))) - set("#*,/?[]{}%")))
"""Characters that are not percent-encoded in addresses. OSC 1.0 allows printable ASCII without the space and
without the special characters of address patterns. The percent sign is excluded, because it begins an encoded
character."""
_MAX_TREES = 64
"""Maximum number of cached lists of messages. It is enough, because few sets of performers and characters
occur on a stage."""
_XYZW = [4, 5, 6, 3]
"""Indices of x, y, z and w of the rotation in a row of the stage."""
_Leaves = Sequence[tuple[str, str]]
"""Pairs of the last part of an address and the OSC type tags of its numbers."""
_GLOBAL: _Leaves = (("time", "f"), ("performers", "i"))
_PERFORMER: _Leaves = (
    *((f"joint/{joint.name.lower()}", "fff") for joint in Joint),
    *((f"confidence/{joint.name.lower()}", "f") for joint in Joint),
    *(("contact/left", "f"), ("contact/right", "f"), ("height", "f")),
)
_CHARACTER: _Leaves = (("position", "fff"), ("rotation", "ffff"), ("held", "i"))
_PROP: _Leaves = (("position", "fff"),)


@dataclass(frozen=True)
class OscAddressFile:
    """The content of a mapping file."""

    others: bool = setting(
        True,
        "Also sends messages with addresses that the file does not list. These addresses stay unchanged.",
    )
    addresses: dict[str, str] = field(
        default_factory=dict,
        metadata={
            "doc": (
                "New address for each original address. * stands for one part of an address. An empty "
                "text drops the message."
            )
        },
    )


class OscAddressMap:
    """Renames OSC addresses.

    Args:
        file: the new addresses.
        where: the path of the file, for error messages.

    Raises:
        InputError: if an address does not begin with a slash, or a new address contains more stars than the
            old one.
    """

    def __init__(self, file: OscAddressFile | None = None, where: str = "") -> None:
        self._file = file or OscAddressFile()
        self._patterns: list[tuple[re.Pattern[str], str]] = []
        self._known: dict[str, str] = {}
        for old, new in self._file.addresses.items():
            self._patterns.append(_pattern(old, new, where))

    def rename(self, address: str) -> str:
        """Returns the new name of an address, or an empty string if the address is not sent."""
        if address not in self._known:
            self._known[address] = self._renamed(address)
        return self._known[address]

    def _renamed(self, address: str) -> str:
        for pattern, new in self._patterns:
            if match := pattern.fullmatch(address):
                # A checked address contains no braces, so it is safe to use as a format string.
                return new.replace("*", "{}").format(*match.groups())
        return address if self._file.others else ""


def read_address_map(path: Path) -> OscAddressMap:
    """Reads a mapping file.

    Raises:
        InputError: if the file cannot be read or an entry is invalid.
    """
    return OscAddressMap(load_settings(OscAddressFile, path), str(path))


def _pattern(old: str, new: str, where: str) -> tuple[re.Pattern[str], str]:
    if not old.startswith(f"{ROOT}/") or (new and not new.startswith("/")) or _encode_names(new) != new:
        remedy = (
            f'Write "{ROOT}/..." = "/...", or = "" to drop the message. The new address may contain '
            "only printable "
            "ASCII characters, without spaces and # , ? [ ] { }."
        )
        raise InputError(f"the line {old!r} = {new!r} does not rename an address", where=where, remedy=remedy)
    if new.count("*") > old.count("*"):
        remedy = "Every * of the new address needs a * in the old address."
        raise InputError(
            f"the new address {new!r} contains more * than the old address {old!r}",
            where=where,
            remedy=remedy,
        )
    return re.compile("([^/]+)".join(map(re.escape, _encode_names(old).split("*")))), new


class OscOutput(LiveOutput):
    """An output that sends the tree of OSC addresses below ``/enliven``.

    Args:
        addresses: the mapping that renames the addresses. If None, they are not renamed.
    """

    def __init__(self, addresses: OscAddressMap | None = None) -> None:
        self._addresses = addresses or OscAddressMap()
        self._templates = OscTemplates()
        self._trees: dict[Hashable, tuple[list[OscMessage], Int]] = {}
        self._first_ns: int | None = None

    def encode_packets(self, frame: LiveFrame) -> list[bytes]:
        """Returns the events since the last frame, followed by the tree of addresses.

        The clock below ``/enliven`` starts at the first frame, and starts again if the time goes backwards.
        The message layout is cached for each set of characters and performers, so that a frame only fills in
        numbers.
        """
        if self._first_ns is None or frame.time_ns < self._first_ns:
            self._first_ns = frame.time_ns
        rows = frame.rows
        key = rows.key
        if key not in self._trees:
            if len(self._trees) >= _MAX_TREES:
                self._trees.clear()
            self._trees[key] = self._tree(rows)
        messages, kept_indices = self._trees[key]
        seconds = (frame.time_ns - self._first_ns) * 1e-9
        parts = [np.array([seconds, len(frame.performers)])]
        for body in frame.performers.values():
            parts += _performer_values(body)
        names, placed = rows.names, np.empty((len(rows.names), 8))
        placed[:, :3], placed[:, 3:7] = rows.values[: len(names), :3], rows.values[: len(names), _XYZW]
        placed[:, 7] = [name in frame.held for name in names]
        parts.append(placed.ravel())
        if frame.props is not None:
            parts.append(frame.props.positions.ravel())
        tree = self._templates.packets(key, lambda: messages, np.concatenate(parts)[kept_indices])
        return [*self._events(frame), *tree]

    def _tree(self, rows: StageRows) -> tuple[list[OscMessage], Int]:
        """Returns the messages of a stage, and the indices of the stage's numbers that they contain."""
        _, performers, props = rows.key
        blocks = [("", _GLOBAL), *((f"performer/{number}", _PERFORMER) for number in performers)]
        blocks += [(f"character/{_encode_name(name)}", _CHARACTER) for name in rows.names]
        blocks += [(f"prop/{number}", _PROP) for number in props]
        messages, kept_indices, first = [], list[int](), 0
        for path, leaves in blocks:
            for leaf, types in leaves:
                if address := self._addresses.rename("/".join(filter(None, (ROOT, path, leaf)))):
                    messages.append(OscMessage(address, types))
                    kept_indices += range(first, first + len(types))
                first += len(types)
        return messages, np.array(kept_indices, np.intp)

    def _events(self, frame: LiveFrame) -> list[bytes]:
        """Returns a list with one packet that contains the events of the frame. The list is empty without
        events."""
        events = [(self._addresses.rename(f"{ROOT}/event/{event.kind}"), event) for event in frame.events]
        sent = [(address, event) for address, event in events if address]
        messages = [OscMessage(address, "i", _event_words(event)) for address, event in sent]
        if not messages:
            return []
        return OscTemplate(messages).packets(np.array([event.performer for _, event in sent], np.float64))


def _event_words(event: LiveEvent) -> tuple[str, ...]:
    return (event.character,) if event.character else ()


def _performer_values(body: Body) -> list[AnyArray]:
    """Returns the numbers of one performer, in the order of ``_PERFORMER``."""
    contacts = np.zeros(2) if body.contacts is None else body.contacts
    return [body.joints.ravel(), body.confidence, contacts, np.array([body.height])]


def _encode_name(name: str) -> str:
    """Returns a name, percent-encoded as one part of an OSC address. Different names stay different."""
    return quote(name, safe=_PLAIN, errors="surrogatepass") or "%"


def _encode_names(address: str) -> str:
    """Encodes the names in an address of a mapping file by percent-encoding. Names that are already encoded
    stay unchanged."""
    return quote(address, safe=f"{_PLAIN}/*%", errors="surrogatepass")
