"""The table of outputs: the protocol of each scheme, with its default port. A new one is one more line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from enliven_edge.outputs.address import OutputAddress
from enliven_edge.outputs.output import LiveOutput
from enliven_edge.outputs.settings import LiveOutputSettings


@dataclass(frozen=True)
class Protocol:
    """One protocol of outputs.

    Attributes:
        port: default port of its receivers.
        open: returns the output. Its module is imported only here, because it needs optional libraries.
        library: Python module that it needs, of the extra ``outputs``.
        sources: the sources that an address may name: "any", only "performers", or "none".
        keys: keys of :class:`LiveOutputSettings` that only this protocol uses.
    """

    port: int
    open: Callable[[OutputAddress, LiveOutputSettings, Path], LiveOutput]
    library: str
    sources: str = "none"
    keys: tuple[str, ...] = ()


def _vmc(address: OutputAddress, settings: LiveOutputSettings, folder: Path) -> LiveOutput:
    from enliven_edge.outputs.vmc import VmcOutput

    return VmcOutput(address.source)


def _vrchat(address: OutputAddress, settings: LiveOutputSettings, folder: Path) -> LiveOutput:
    from enliven_edge.outputs.vrchat import VrchatOutput

    return VrchatOutput(address.source, settings.height)


def _rokoko(address: OutputAddress, settings: LiveOutputSettings, folder: Path) -> LiveOutput:
    from enliven_edge.outputs.rokoko import RokokoOutput

    return RokokoOutput(settings.compress)


def _osc(address: OutputAddress, settings: LiveOutputSettings, folder: Path) -> LiveOutput:
    from enliven_edge.outputs.osc_tree import OscOutput, read_address_map

    return OscOutput(read_address_map(folder / settings.map) if settings.map else None)


OUTPUTS = {
    "vmc": Protocol(39539, _vmc, "pythonosc", "any"),
    "vrchat": Protocol(9000, _vrchat, "pythonosc", "performers", ("height",)),
    "rokoko": Protocol(14043, _rokoko, "lz4", keys=("compress",)),
    "osc": Protocol(10000, _osc, "pythonosc", keys=("map",)),
}
"""The protocols by scheme."""
