"""Converts between changes of holds and their messages; pure functions."""

from __future__ import annotations

import numpy as np

from enliven.document import HoldEvent
from enliven.person import Body
from enliven.wire.fields import MAX_SETTINGS, from_bytes, to_bytes
from enliven.wire.streams import HoldMessage


def hold_to_message(event: HoldEvent, revision: int) -> HoldMessage:
    """Returns the message of a change of holds; settings that are too long for the wire are left out."""
    body = event.body
    return HoldMessage(
        event.character,
        event.time_ns,
        event.mode,
        revision,
        -1 if event.performer is None else int(event.performer),
        event.parts,
        -1 if event.former is None else int(event.former),
        [int(one) for one in event.holders[:64]],
        b"" if body is None else to_bytes(body.joints, "<f4"),
        b"" if body is None else to_bytes(np.nan_to_num(body.confidence), "<f4"),
        0.0 if body is None or body.stature is None else float(body.stature),
        event.settings if len(event.settings) <= MAX_SETTINGS else "{}",
        [float(number) for number in event.place],
        float(event.size),
    )


def message_to_hold(message: HoldMessage) -> HoldEvent:
    """The change of holds; a joint that was not known stays NaN."""
    who = None if message.body < 0 else message.body
    body = None
    if message.joints and who is not None:
        joints = from_bytes(message.joints, "<f4", 3).astype(np.float64)
        confidence = from_bytes(message.confidence, "<f4", 1)[:, 0].astype(np.float64)
        body = Body(who, joints, np.clip(confidence, 0.0, 1.0), stature=message.stature or None)
    return HoldEvent(
        message.character,
        message.time_ns,
        message.mode,
        who,
        message.parts,
        None if message.former < 0 else message.former,
        body,
        tuple(message.holders),
        message.settings,
        tuple(message.place),
        message.size,
    )
