"""The interface of every live output."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from enliven_edge.outputs.live_frame import CharacterInfo, LiveFrame


class Output(Protocol):
    """A protocol: turns frames into UDP packets. Used from one thread."""

    def packets(self, frame: LiveFrame) -> list[bytes]:
        """Returns the packets of one frame, in the order in which they are sent."""
        ...

    def check(self, characters: Mapping[str, CharacterInfo]) -> None:
        """Checks the characters that are on the stage at the start.

        Raises:
            InputError: if the output cannot send what its address names.
        """
        ...
