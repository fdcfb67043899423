"""The base class of the protocols that send UDP packets."""

from __future__ import annotations

from collections.abc import Mapping

from enliven.outputs.live_frame import CharacterInfo, LiveFrame


class LiveOutput:
    """A protocol that converts frames to UDP packets. It must be used from one thread only."""

    def encode_packets(self, frame: LiveFrame) -> list[bytes]:
        """Returns the packets of one frame, in the order in which they are sent."""
        raise NotImplementedError

    def check(self, characters: Mapping[str, CharacterInfo]) -> None:
        """Checks that the output can send the characters that are on the stage at the start. Most protocols
        can send any character.

        Raises:
            InputError: if the output cannot send the character that its address names.
        """
