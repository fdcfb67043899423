"""Converts between changes of holds and their messages; pure functions."""

from __future__ import annotations

from enliven.document import HoldEvent
from enliven.wire.fields import MAX_SETTINGS
from enliven.wire.streams import HoldMessage


def hold_to_message(event: HoldEvent, revision: int) -> HoldMessage:
    """Returns the message of a change of holds; settings that are too long for the wire are left out."""
    return HoldMessage(
        event.character,
        event.time_ns,
        event.mode,
        revision,
        -1 if event.performer is None else int(event.performer),
        event.parts,
        -1 if event.former is None else int(event.former),
        [int(one) for one in event.holders[:64]],
        event.settings if len(event.settings) <= MAX_SETTINGS else "{}",
        [float(number) for number in event.place],
        float(event.size),
    )


def message_to_hold(message: HoldMessage) -> HoldEvent:
    """The change of holds."""
    return HoldEvent(
        message.character,
        message.time_ns,
        message.mode,
        None if message.body < 0 else message.body,
        message.parts,
        None if message.former < 0 else message.former,
        tuple(message.holders),
        message.settings,
        tuple(message.place),
        message.size,
    )
