"""Scaling of characters by the distance between a performer's hands, as the authors of KinÊtre suggest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.person import Body, Joint
from enliven.possession import Actor
from enliven.wire import MAX_GROWTH, Resize, SizeMessage
from enliven_edge.stage.stage import Stage

_HANDS = (Joint.HAND_LEFT, Joint.HAND_RIGHT)
_MIN_CONFIDENCE = 0.3
"""Minimum confidence of both hands. Below it, the last distance between the hands is used."""
DISTANCE_OFFSET_M = 0.15
"""Metres added to the distance between the hands. Without it, hands that start close together would cause a
huge scale."""
DEAD_BAND = float(np.log(1.06))
"""Dead band of the logarithm of the distance. The size follows only changes above 6 %, because hands never
keep still."""
_SMOOTHING_S = 0.12
"""Time constant in seconds of the smoothing of the size. It suppresses the tracker's noise."""
_GESTURE_END_S = 1.5
"""Seconds without a change of size after which the gesture ends. Pauses within a gesture are shorter."""
_MIN_SENT_CHANGE = 0.005
"""Minimum relative change of size that is sent to windows during a gesture."""


@dataclass
class _Gesture:
    """One performer's scaling gesture. Sizes are natural logarithms of the scale.

    Attributes:
        away: logarithm of the initial distance of the hands in metres; None until both are visible.
        target_log: target size relative to the start.
        still_ns: time of the last change of the target in nanoseconds.
    """

    body: int
    first: float
    away: float | None = None
    target_log: float = 0.0
    still_ns: int | None = None


class HandSizing:
    """The sizes of the characters on a stage, and the gestures that change them.

    If the distance between the hands doubles, the character becomes twice as large, within 1 / ``MAX_GROWTH``
    and ``MAX_GROWTH`` times its own size. The gesture ends when the command that started it is repeated, or
    when the hands hold still. The character then keeps its size.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._gestures: dict[str, _Gesture] = {}
        self._sent: dict[str, tuple[float, int, float | None]] = {}
        self._time_ns = 0

    def handle(self, order: Resize) -> None:
        """Starts or ends a gesture, sets a size, or sets how far soft parts swing.

        Raises:
            InputError: if the character or performer does not exist, or if the character's size cannot
                change.
        """
        name, performer = self._find_target(order)
        actor = self._stage.actors[name]
        if order.do == "exaggerate":
            actor.exaggerate(order.exaggeration)
        elif order.do == "set":
            self._gestures.pop(name, None)
            actor.resize(order.size, self._find_fixed_point(name, None), fade=True)
        elif name in self._gestures:
            del self._gestures[name]
        elif order.do == "hands":
            # This raises an error if the size of the character cannot change.
            actor.resize(actor.growth, self._find_fixed_point(name, None))
            self._gestures[name] = _Gesture(performer, float(np.log(actor.growth)))

    def follow(self, bodies: list[Body], time_ns: int) -> None:
        """Moves the sizes of the characters towards the target sizes of the gestures."""
        seconds, self._time_ns = max(time_ns - self._time_ns, 0) * 1e-9, time_ns
        present = {body.id: body for body in bodies}
        for name, gesture in list(self._gestures.items()):
            actor, body = self._stage.actors.get(name), present.get(gesture.body)
            if actor is None or body is None or _is_finished(gesture, time_ns):
                del self._gestures[name]
                continue
            _update_target(gesture, body, time_ns)
            target = float(
                np.clip(gesture.first + gesture.target_log, -np.log(MAX_GROWTH), np.log(MAX_GROWTH))
            )
            current_log = float(np.log(actor.growth))
            current_log += (target - current_log) * (1.0 - float(np.exp(-seconds / _SMOOTHING_S)))
            actor.resize(float(np.exp(current_log)), self._find_fixed_point(name, body))

    def changes(self) -> list[SizeMessage]:
        """Returns the sizes that changed, and the gestures that started or ended, since the last call."""
        messages = []
        for name, actor in self._stage.actors.items():
            gesture = self._gestures.get(name)
            current = actor.growth, -1 if gesture is None else gesture.body, actor.exaggeration
            sent = self._sent.get(name, (1.0, -1, None))
            moved = abs(current[0] / sent[0] - 1.0) > (_MIN_SENT_CHANGE if gesture is not None else 1e-9)
            if moved or current[1:] != sent[1:]:
                self._sent[name] = current
                messages.append(SizeMessage(name, *current))
        for name in self._sent.keys() - self._stage.actors.keys():
            del self._sent[name]
            messages.append(SizeMessage(name, 1.0, -1))
        return messages

    def _find_target(self, order: Resize) -> tuple[str, int]:
        """Returns the character and the performer of an order.

        The performer is the holder of the character, or else the next candidate.
        """
        stage = self._stage
        name = order.character
        if name is None:
            gesture = next(iter(self._gestures), None)
            possession = next(
                iter([*stage.pending_possessions("extend"), *stage.pending_possessions()]), None
            )
            name = gesture or (possession.character if possession else None)
        if name not in stage.actors:
            problem = "there is no character" if name is None else f"there is no character {name!r}"
            raise InputError(
                problem,
                where="sizing",
                remedy=f"Characters on the stage: {', '.join(stage.actors) or 'none'}.",
            )
        if order.do != "hands" or name in self._gestures:
            return name, -1
        performer = stage.candidate(name, "extend")[0] if order.body is None else order.body
        performer = stage.first_in_view if performer is None else performer
        if performer is None:
            remedy = "Step in front of the sensor first."
            raise InputError("nobody is in view", where=f"sizing {name!r}", remedy=remedy)
        return name, performer

    def _find_fixed_point(self, name: str, body: Body | None) -> Float | None:
        """Returns the point on the floor that scaling does not move, (3,) in metres.

        It is under the performer who possesses the character. If None, it is the character's own point.
        """
        actor: Actor = self._stage.actors[name]
        if body is None or all(hold.body != body.id for hold in actor.holds):
            return None
        hip = body.joints[Joint.HIP_CENTER]
        return np.array([hip[0], 0.0, hip[2]]) if np.isfinite(hip).all() else None


def _update_target(gesture: _Gesture, body: Body, time_ns: int) -> None:
    """Updates the target size from the distance of the hands, with a dead band."""
    left, right = (body.joints[hand] for hand in _HANDS)
    are_visible = all(body.confidence[hand] >= _MIN_CONFIDENCE for hand in _HANDS)
    if not (are_visible and np.isfinite(left).all() and np.isfinite(right).all()):
        return
    log_distance = float(np.log(np.linalg.norm(left - right) + DISTANCE_OFFSET_M))
    if gesture.away is None:
        gesture.away = log_distance
    target, previous_log = log_distance - gesture.away, gesture.target_log
    gesture.target_log = float(np.clip(previous_log, target - DEAD_BAND, target + DEAD_BAND))
    if gesture.target_log != previous_log:
        gesture.still_ns = time_ns


def _is_finished(gesture: _Gesture, time_ns: int) -> bool:
    """Returns True if the hands have changed the size and then kept still for long enough."""
    return gesture.still_ns is not None and (time_ns - gesture.still_ns) * 1e-9 > _GESTURE_END_S
