"""The table of the edge's actions for each kind of order, from viewers and from controls."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from enliven.matching import ScreenView
from enliven.wire import (
    Browse,
    CharacterPart,
    Listen,
    Lock,
    Look,
    Order,
    PlayPhysics,
    Possess,
    PutCharacter,
    Release,
    RemoveCharacter,
    Resize,
    Scan,
    Smooth,
)
from enliven_edge.network import Handler

if TYPE_CHECKING:
    from enliven_edge.character_upload import CharacterUploads
    from enliven_edge.controls import Controls
    from enliven_edge.physics import PhysicsSwitch
    from enliven_edge.scans import Scans
    from enliven_edge.stage import HandSizing, Stage
    from enliven_edge.tracking import Tracker

_SINGLE_SUBJECT = 0
"""The subject of orders that replace each other whatever their content."""


class OrderTarget(Protocol):
    """The parts of the edge that orders act on."""

    stage: Stage
    uploads: CharacterUploads
    scans: Scans
    tracker: Tracker
    sizing: HandSizing
    controls: Controls
    physics: PhysicsSwitch


def create_handlers(edge: OrderTarget) -> dict[type[Order], Handler]:
    """Returns the handler of each kind of order. A new kind needs one more line."""
    return {
        Possess: Handler(lambda order: _possess(edge.stage, order), _subject_of_possession),
        Release: Handler(
            lambda order: edge.stage.release(order.character, order.body),
            lambda order: (order.character, order.body),
        ),
        Smooth: Handler(
            lambda order: edge.tracker.output.smooth(order.body, order.amount), lambda order: order.body
        ),
        Look: Handler(lambda order: edge.stage.set_view(_screen_view(order)), lambda order: _SINGLE_SUBJECT),
        Browse: Handler(lambda order: edge.stage.browse(order.character, order.step)),
        Lock: Handler(lambda order: _lock(edge.tracker, order.on), lambda order: _SINGLE_SUBJECT),
        PutCharacter: Handler(lambda order, peer: edge.uploads.put(order, peer), takes_peer=True),
        CharacterPart: Handler(lambda order, peer: edge.uploads.take(order, peer), takes_peer=True),
        RemoveCharacter: Handler(lambda order: edge.stage.remove(order.character)),
        Resize: Handler(lambda order: edge.sizing.ask(order)),
        Scan: Handler(lambda order: edge.scans.ask(order)),
        Listen: Handler(lambda order: edge.controls.listen(order.on), lambda order: _SINGLE_SUBJECT),
        PlayPhysics: Handler(lambda order: edge.physics.ask(order.world), lambda order: _SINGLE_SUBJECT),
    }


def _possess(stage: Stage, request: Possess) -> None:
    """Lets a performer possess a character, or previews the parts that the performer would hold."""
    if request.mode == "preview":
        stage.preview(request.character, request.body, request.parts)
    else:
        stage.possess(request.character, request.body, request.parts, request.mode)


def _subject_of_possession(request: Possess) -> tuple[str, str | None] | None:
    """Returns the subject that a newer request replaces.

    Each "join" and "extend" counts, since it adds holds.
    """
    return (request.mode, request.character) if request.mode in ("alone", "preview") else None


def _screen_view(request: Look) -> ScreenView:
    """Returns a viewer's view."""
    eye = None if request.eye is None else np.array(request.eye)
    return ScreenView(np.array(request.direction), np.array(request.up), eye)


def _lock(tracker: Tracker, on: bool) -> None:
    """Locks the cast, so that only people that are tracked now can perform, or unlocks it."""
    if on:
        tracker.lock()
    else:
        tracker.unlock()
