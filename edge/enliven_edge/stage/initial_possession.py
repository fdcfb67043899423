"""The possession that the command line requests for the start of a performance."""

from __future__ import annotations

import logging
from collections.abc import Mapping

from enliven.errors import InputError
from enliven_edge.stage.stage import Stage

log = logging.getLogger(__name__)


class InitialPossession:
    """Lets each performer possess a character on appearing: the first one with the first parts, and so on.

    Args:
        at: seconds after the first frame, or None for never.
        parts: the body parts that possess, such as "all". For several performers, separated as in "legs /
            upper body". One text for all characters, or a mapping by character id.
    """

    def __init__(self, stage: Stage, at: float | None, parts: str | Mapping[str, str] = "all") -> None:
        self._stage, self._at = stage, at
        each = {name: parts if isinstance(parts, str) else parts.get(name, "all") for name in stage.actors}
        self._due = [(name, [part.strip() for part in text.split("/")]) for name, text in each.items()]

    def take_hold(self, seconds: float) -> None:
        """Lets the performers in view possess characters if that is due ``seconds`` after the first frame."""
        if self._at is None or seconds < self._at:
            return
        for name, parts in self._due:
            while parts and name in self._stage.actors and self._stage.idle(name) is not None:
                now = parts.pop(0)
                try:
                    self._stage.possess(name, parts=now, mode="join")
                    log.info("%s is possessed with %s at %.2f s", name, now, seconds)
                except InputError as error:
                    # The part is unknown, or the mesh is out of reach. Report this once, and do not try
                    # again.
                    log.error("%s", error)
