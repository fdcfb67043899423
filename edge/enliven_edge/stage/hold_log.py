"""The log of holds. A hold is the possession of a character by a performer."""

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
    """Collects the starts and ends of all holds until they are sent to viewers and written to the take.

    Attributes:
        time_ns: time of the last performed frame, nanoseconds of the sensor's clock.
    """

    def __init__(self) -> None:
        self.time_ns = 0
        self._events: list[HoldMessage] = []

    def possess(self, actor: Actor, body: Body, parts: str, mode: Mode) -> None:
        """Lets a performer possess a character.

        Raises:
            InputError: if the actor refuses. In that case nothing is logged.
        """
        place = actor.place
        actor.possess(body, parts, mode)
        self._add_event(actor, mode, body.id, parts=parts, place=place)

    def release(self, actor: Actor, body: int | None) -> None:
        """Ends the hold of one performer, or of all.

        Raises:
            InputError: if that performer does not hold the character.
        """
        place, was_held = actor.place, bool(actor.holds)
        actor.release(body)
        if was_held:
            self._add_event(actor, "release", body, place=place)

    @contextmanager
    def log_automatic_changes(self, actor: Actor, time_ns: int) -> Iterator[None]:
        """Logs, as a context manager, the holds that the actor itself transfers, starts or ends within a
        frame.
        """
        holders_before = [hold.body for hold in actor.holds]
        yield
        self.time_ns = time_ns
        holders_after = [hold.body for hold in actor.holds]
        if holders_after == holders_before:
            return
        released = [holder for holder in holders_before if holder not in holders_after]
        for body in holders_after:
            if body not in holders_before:
                previous = released.pop(0) if released else None
                self._add_event(actor, "join" if previous is None else "take over", body, previous=previous)
        for body in released:
            self._add_event(actor, "release", body)

    def log_carried_over(self, actor: Actor, carried: HoldStarts) -> None:
        """Logs the holds that moved from a replaced character to this one."""
        for hold in carried:
            self._add_event(actor, "join", hold.body.id, parts=hold.parts, place=actor.place)

    def log_removal(self, actor: Actor) -> None:
        """Logs that a character left the stage."""
        self._events.append(HoldMessage(actor.character.id, self.time_ns, "remove"))

    def drain(self) -> list[HoldMessage]:
        """Returns and clears the events since the last call."""
        events, self._events = self._events, []
        return events

    def _add_event(
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
