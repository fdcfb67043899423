"""The log of holds: which performer possessed or released which character, and how."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict

from enliven.document import HoldMode
from enliven.person import Body
from enliven.possession import Actor, Mode
from enliven.wire import MAX_SETTINGS_LENGTH, HoldMessage
from enliven_edge.stage.hold_memory import HoldStarts


class HoldLog:
    """Collects the events of all characters' holds until they are sent to viewers and written to the take.

    Attributes:
        time_ns: nanoseconds of the sensor's clock, of the last frame that was performed.
    """

    def __init__(self) -> None:
        self.time_ns = 0
        self._events: list[HoldMessage] = []

    def possess(self, actor: Actor, body: Body, parts: str, mode: Mode) -> None:
        """Lets a performer possess a character.

        Raises:
            InputError: if the actor refuses. Nothing is logged then.
        """
        place = actor.place
        actor.possess(body, parts, mode)
        self._add(actor, mode, body.id, parts=parts, place=place)

    def release(self, actor: Actor, body: int | None) -> None:
        """Ends the hold of one performer, or of all.

        Raises:
            InputError: if that performer does not hold the character.
        """
        place, held = actor.place, bool(actor.holds)
        actor.release(body)
        if held:
            self._add(actor, "release", body, place=place)

    @contextmanager
    def frame(self, actor: Actor, time_ns: int) -> Iterator[None]:
        """Logs holds that the actor itself changes within a frame: handed over, started or ended."""
        before = [hold.body for hold in actor.holds]
        yield
        self.time_ns = time_ns
        after = [hold.body for hold in actor.holds]
        if after == before:
            return
        released = [holder for holder in before if holder not in after]
        for body in after:
            if body not in before:
                previous = released.pop(0) if released else None
                self._add(actor, "join" if previous is None else "take over", body, previous=previous)
        for body in released:
            self._add(actor, "release", body)

    def carried_over(self, actor: Actor, carried: HoldStarts) -> None:
        """Logs the performers that hold a character after it replaced another one."""
        for taken in carried:
            self._add(actor, "join", taken.body.id, parts=taken.parts, place=actor.place)

    def removed(self, actor: Actor) -> None:
        """Logs that a character left the stage."""
        self._events.append(HoldMessage(actor.character.id, self.time_ns, "remove"))

    def take(self) -> list[HoldMessage]:
        """Returns and clears the events since the last call."""
        events, self._events = self._events, []
        return events

    def _add(
        self,
        actor: Actor,
        mode: HoldMode,
        body: int | None,
        *,
        place: tuple[float, ...] = (),
        parts: str = "all",
        previous: int | None = None,
    ) -> None:
        settings = json.dumps(asdict(actor.settings))
        self._events.append(
            HoldMessage(
                actor.character.id,
                self.time_ns,
                mode,
                body=-1 if body is None else body,
                parts=parts,
                former=-1 if previous is None else previous,
                holders=[hold.body for hold in actor.holds],
                settings=settings if len(settings) <= MAX_SETTINGS_LENGTH else "{}",
                place=list(place),
                size=actor.size,
            )
        )
