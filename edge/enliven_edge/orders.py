"""The handlers of orders. An order is a request from a viewer or a control."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from enliven.matching.views import ScreenView
from enliven.wire import (
    Browse,
    CharacterPart,
    Done,
    LearnRoom,
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
from enliven_edge.network.handlers import Handler

if TYPE_CHECKING:
    from enliven_edge.character_upload import CharacterUploads
    from enliven_edge.controls.control_set import Controls
    from enliven_edge.physics.switch import PhysicsSwitch
    from enliven_edge.scans import Scans
    from enliven_edge.sensors import Sensor
    from enliven_edge.stage.sizing import HandSizing
    from enliven_edge.stage.stage import Stage
    from enliven_edge.tracking.tracker import Tracker

_SINGLE_SUBJECT = 0
"""Subject of orders that always replace each other, independent of their content."""


class OrderTarget(Protocol):
    """The parts of the edge that orders change."""

    sensor: Sensor
    stage: Stage
    uploads: CharacterUploads
    scans: Scans
    tracker: Tracker
    sizing: HandSizing
    controls: Controls
    physics: PhysicsSwitch


def create_handlers(edge: OrderTarget) -> dict[type[Order], Handler]:
    """Returns the handler of each kind of order. A new kind of order needs an entry here."""
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
        Lock: Handler(lambda order: _set_cast_lock(edge.tracker, order.on), lambda order: _SINGLE_SUBJECT),
        LearnRoom: Handler(lambda order: _learn_room(edge), lambda order: _SINGLE_SUBJECT),
        PutCharacter: Handler(lambda order, peer: edge.uploads.announce(order, peer), takes_peer=True),
        CharacterPart: Handler(lambda order, peer: edge.uploads.add_part(order, peer), takes_peer=True),
        RemoveCharacter: Handler(lambda order: edge.stage.remove(order.character)),
        Resize: Handler(lambda order: edge.sizing.handle(order)),
        Scan: Handler(lambda order: edge.scans.execute_order(order)),
        Listen: Handler(lambda order: edge.controls.listen(order.on), lambda order: _SINGLE_SUBJECT),
        PlayPhysics: Handler(
            lambda order: edge.physics.switch_to(order.world), lambda order: _SINGLE_SUBJECT
        ),
    }


def _possess(stage: Stage, request: Possess) -> None:
    """Lets a performer possess a character, or previews the parts that the performer would possess."""
    if request.mode == "preview":
        stage.preview(request.character, request.body, request.parts)
    else:
        stage.possess(request.character, request.body, request.parts, request.mode)


def _subject_of_possession(request: Possess) -> tuple[str, str | None] | None:
    """Returns the subject of a request. A newer request with the same subject replaces a waiting one.

    Requests with "join" and "extend" have no subject, because each of them adds a hold.
    """
    return (request.mode, request.character) if request.mode in ("alone", "preview") else None


def _screen_view(request: Look) -> ScreenView:
    """Returns the view direction of a viewer from its request."""
    eye = None if request.eye is None else np.array(request.eye)
    return ScreenView(np.array(request.direction), np.array(request.up), eye)


def _set_cast_lock(tracker: Tracker, on: bool) -> None:
    """Locks the cast, so that only people who are tracked now may perform, or unlocks it."""
    if on:
        tracker.lock()
    else:
        tracker.unlock()


def _learn_room(edge: OrderTarget) -> Done:
    """Learns the background and the floor of each sensor again."""
    # If there are several sensors, each has its own tracker. The edge's tracker only smooths their fused
    # bodies.
    learn_room = getattr(edge.sensor, "learn_room", edge.tracker.learn_room)
    learn_room()
    return Done("the edge learns the room again")
