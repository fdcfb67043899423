"""Scaling of characters by the distance between both hands, as the authors of KinÊtre wished."""

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
"""Minimum confidence of a hand. Below it the hand is ignored and its last distance is kept."""
_DISTANCE_OFFSET_M = 0.15
"""Metres added to every distance, so that hands that start close together do not cause a huge scale at
once."""
_DEAD_BAND = float(np.log(1.06))
"""Dead band: hands never keep still, so the size follows only beyond 6 % of distance change."""
_SMOOTHING_S = 0.12
"""Time constant in seconds of the size's smoothing, which hides the tracker's noise."""
_GESTURE_END_S = 1.5
"""Time for which the hands must be still after a change of size until the gesture ends, in seconds. A pause
within the gesture is shorter."""
_MIN_SENT_CHANGE = 0.005
"""Smallest relative change of size that is sent to windows during a gesture."""


@dataclass
class _Gesture:
    """One performer's gesture. Sizes are natural logarithms: at the start, and the target.

    Attributes:
        away: logarithm of the distance of the hands at the start, in metres. None until both are visible.
        target_log: target size relative to the start.
        still_ns: time since which the target has not changed.
    """

    body: int
    first: float
    away: float | None = None
    target_log: float = 0.0
    still_ns: int | None = None


class HandSizing:
    """The sizes of the characters on a stage, and the gestures that change them.

    Hands twice as far apart make a character twice as large, between 1 / ``MAX_GROWTH`` and ``MAX_GROWTH`` of
    its own size. The size stays when the gesture ends: by the command that started it, or by holding still.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._gestures: dict[str, _Gesture] = {}
        self._told: dict[str, tuple[float, int, float | None]] = {}
        self._time_ns = 0

    def ask(self, order: Resize) -> None:
        """Starts or ends a gesture, sets a size, or sets how far soft parts swing.

        Raises:
            InputError: if character or performer do not exist, or its size cannot change.
        """
        name, who = self._find_target(order)
        actor = self._stage.actors[name]
        if order.do == "exaggerate":
            actor.exaggerate(order.exaggeration)
        elif order.do == "set":
            self._gestures.pop(name, None)
            actor.resize(order.size, self._find_fixed_point(name, None), fade=True)
        elif name in self._gestures:
            del self._gestures[name]
        elif order.do == "hands":
            # This raises an error if the size cannot change.
            actor.resize(actor.growth, self._find_fixed_point(name, None))
            self._gestures[name] = _Gesture(who, float(np.log(actor.growth)))

    def follow(self, bodies: list[Body], time_ns: int) -> None:
        """Moves the sizes of the characters towards those that the performers' hands ask for."""
        seconds, self._time_ns = max(time_ns - self._time_ns, 0) * 1e-9, time_ns
        present = {body.id: body for body in bodies}
        for name, gesture in list(self._gestures.items()):
            actor, body = self._stage.actors.get(name), present.get(gesture.body)
            if actor is None or body is None or _is_finished(gesture, time_ns):
                del self._gestures[name]
                continue
            _update_target(gesture, body, time_ns)
            wanted = float(
                np.clip(gesture.first + gesture.target_log, -np.log(MAX_GROWTH), np.log(MAX_GROWTH))
            )
            now = float(np.log(actor.growth))
            now += (wanted - now) * (1.0 - float(np.exp(-seconds / _SMOOTHING_S)))
            actor.resize(float(np.exp(now)), self._find_fixed_point(name, body))

    def changes(self) -> list[SizeMessage]:
        """Returns changes since the last call: sizes that changed, and gestures that started or ended."""
        messages = []
        for name, actor in self._stage.actors.items():
            gesture = self._gestures.get(name)
            current = actor.growth, -1 if gesture is None else gesture.body, actor.exaggeration
            before = self._told.get(name, (1.0, -1, None))
            moved = abs(current[0] / before[0] - 1.0) > (_MIN_SENT_CHANGE if gesture is not None else 1e-9)
            if moved or current[1:] != before[1:]:
                self._told[name] = current
                messages.append(SizeMessage(name, *current))
        for name in self._told.keys() - self._stage.actors.keys():
            del self._told[name]
            messages.append(SizeMessage(name, 1.0, -1))
        return messages

    def _find_target(self, order: Resize) -> tuple[str, int]:
        """Returns the character and the performer of an order: the holder of a character, or else the next
        candidate."""
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
            raise InputError(problem, where="sizing", mend=f"Known: {', '.join(stage.actors) or 'none'}.")
        if order.do != "hands" or name in self._gestures:
            return name, -1
        who = stage.candidate(name, "extend")[0] if order.body is None else order.body
        who = stage.first_in_view if who is None else who
        if who is None:
            mend = "Step in front of the sensor first."
            raise InputError("nobody is in view", where=f"sizing {name!r}", mend=mend)
        return name, who

    def _find_fixed_point(self, name: str, body: Body | None) -> Float | None:
        """Returns (3,) metres, the fixed point of the scaling on the floor: under the performer that holds
        the character. None: its own."""
        actor: Actor = self._stage.actors[name]
        if body is None or all(hold.body != body.id for hold in actor.holds):
            return None
        hip = body.joints[Joint.HIP_CENTER]
        return np.array([hip[0], 0.0, hip[2]]) if np.isfinite(hip).all() else None


def _update_target(gesture: _Gesture, body: Body, time_ns: int) -> None:
    """Updates the target size from the distance of the hands, with a dead band."""
    left, right = (body.joints[hand] for hand in _HANDS)
    sure = all(body.confidence[hand] >= _MIN_CONFIDENCE for hand in _HANDS)
    if not (sure and np.isfinite(left).all() and np.isfinite(right).all()):
        return
    away = float(np.log(np.linalg.norm(left - right) + _DISTANCE_OFFSET_M))
    if gesture.away is None:
        gesture.away = away
    wanted, before = away - gesture.away, gesture.target_log
    gesture.target_log = float(np.clip(before, wanted - _DEAD_BAND, wanted + _DEAD_BAND))
    if gesture.target_log != before:
        gesture.still_ns = time_ns


def _is_finished(gesture: _Gesture, time_ns: int) -> bool:
    """Returns True if the hands have changed the size and then kept still for long enough."""
    return gesture.still_ns is not None and (time_ns - gesture.still_ns) * 1e-9 > _GESTURE_END_S
