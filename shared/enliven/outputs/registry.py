"""The registry of outputs: the protocol of each scheme. To add a protocol, add a line to :data:`OUTPUTS`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from enliven.outputs.address import OutputAddress
from enliven.outputs.output import LiveOutput
from enliven.outputs.sender import Sender
from enliven.outputs.settings import LiveOutputSettings
from enliven.person import ROKOKO_PORT


@dataclass(frozen=True)
class Protocol:
    """An output protocol.

    Either ``open`` or ``listen`` is set. They import the protocol's module only when they are called, because
    it requires optional libraries.

    Attributes:
        port: default port of the receivers, or of the server if the output listens.
        library: Python module that the protocol requires.
        open: a function that returns an object that converts frames to UDP packets.
        listen: a function that starts a server, given the name of the output, an IP address and a port.
        extra: the optional dependency group (extra) of enliven that contains the library.
        sources: the sources that an address may name: "any", only "performers", or "none".
        keys: keys of :class:`LiveOutputSettings` that only this protocol uses.
    """

    port: int
    library: str
    open: Callable[[OutputAddress, LiveOutputSettings, Path], LiveOutput] | None = None
    listen: Callable[[str, str, int], Sender] | None = None
    extra: str = "outputs"
    sources: str = "none"
    keys: tuple[str, ...] = ()


def _vmc(address: OutputAddress, settings: LiveOutputSettings, folder: Path) -> LiveOutput:
    from enliven.outputs.vmc import VmcOutput

    return VmcOutput(address.source)


def _vrchat(address: OutputAddress, settings: LiveOutputSettings, folder: Path) -> LiveOutput:
    from enliven.outputs.vrchat import VrchatOutput

    return VrchatOutput(address.source, settings.height)


def _rokoko(address: OutputAddress, settings: LiveOutputSettings, folder: Path) -> LiveOutput:
    from enliven.outputs.rokoko import RokokoOutput

    return RokokoOutput(settings.compress)


def _osc(address: OutputAddress, settings: LiveOutputSettings, folder: Path) -> LiveOutput:
    from enliven.outputs.osc_tree import OscOutput, read_address_map

    return OscOutput(read_address_map(folder / settings.map) if settings.map else None)


def _foxglove(name: str, host: str, port: int) -> Sender:
    from enliven.outputs.foxglove.server import FoxgloveServer

    return FoxgloveServer(name, host, port)


OUTPUTS = {
    "vmc": Protocol(39539, "pythonosc", _vmc, sources="any"),
    "vrchat": Protocol(9000, "pythonosc", _vrchat, sources="performers", keys=("height",)),
    "rokoko": Protocol(ROKOKO_PORT, "lz4", _rokoko, keys=("compress",)),
    "osc": Protocol(10000, "pythonosc", _osc, keys=("map",)),
    "foxglove": Protocol(8765, "foxglove", listen=_foxglove, extra="foxglove", keys=("insecure",)),
}
"""The protocols by scheme."""
