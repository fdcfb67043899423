"""Settings of one live output, ``[outputs.NAME]`` in an edge's settings file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from enliven.settings import setting


@dataclass(frozen=True)
class LiveOutputSettings:
    """Settings of one live output, that is, of one program that receives the motion live."""

    to: str = setting(
        doc="Protocol and receiver, SCHEME:HOST[:PORT][/SOURCE]. Schemes: vmc, vrchat, rokoko, osc, foxglove."
    )
    height: float = setting(
        0.0,
        "vrchat: height of the user as set in VRChat. Positions are scaled to this height. 0: the "
        "performer's own height.",
        unit="m",
        low=0.0,
        high=3.0,
    )
    map: str = setting("", "osc: path of a TOML file that renames addresses, relative to the settings file.")
    compress: bool = setting(
        True, "rokoko: compresses packets as LZ4 frames, as Rokoko Studio does. False: plain JSON."
    )
    insecure: bool = setting(
        False,
        "foxglove: allows an address that other computers can reach. Everyone on that network can "
        "then watch.",
    )


def collect_output_settings(
    words: Sequence[str], settings: Mapping[str, LiveOutputSettings]
) -> dict[str, LiveOutputSettings]:
    """Merges the outputs in the settings with those of the command line option ``--out``. Returns them by
    name."""
    outputs = dict(settings)
    for word in words:
        name = f"--out {word}"
        while name in outputs:  # Equal addresses are refused later, with an error that contains both names.
            name += " again"
        outputs[name] = LiveOutputSettings(to=word)
    return outputs
