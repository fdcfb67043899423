"""Possession of characters at the start of a performance, as requested on the command line."""

from __future__ import annotations

import logging
from collections.abc import Mapping

from enliven.errors import InputError
from enliven_edge.stage.stage import Stage

log = logging.getLogger(__name__)


class InitialPossession:
    """Lets performers possess characters when they appear.

    The first performer uses the first parts, the second performer the second parts, and so on.

    Args:
        at: seconds from the first frame to the possession; None for no possession.
        parts: the body parts that possess, such as "all". Parts of several performers are separated, as in
            "legs / upper body". It is one string for all characters, or a mapping by character id.
    """

    def __init__(self, stage: Stage, at: float | None, parts: str | Mapping[str, str] = "all") -> None:
        self._stage, self._at = stage, at
        parts_by_name = {
            name: parts if isinstance(parts, str) else parts.get(name, "all") for name in stage.actors
        }
        self._pending = [
            (name, [part.strip() for part in text.split("/")]) for name, text in parts_by_name.items()
        ]

    def possess_if_due(self, seconds: float) -> None:
        """Lets the performers in view possess characters if that is due at ``seconds`` after the first
        frame."""
        if self._at is None or seconds < self._at:
            return
        for name, parts in self._pending:
            while parts and name in self._stage.actors and self._stage.find_idle_performer(name) is not None:
                next_parts = parts.pop(0)
                try:
                    self._stage.possess(name, parts=next_parts, mode="join")
                    log.info("%s is possessed with %s at %.2f s", name, next_parts, seconds)
                except InputError as error:
                    # The part is unknown, or the mesh is out of reach. Log this once, and do not try again.
                    log.error("%s", error)
