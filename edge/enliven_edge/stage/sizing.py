"""Both hands make a character larger or smaller, as the authors of KinÊtre wished."""

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
_SURE = 0.3
"""Confidence of a hand below which it is not believed: what it did last counts."""
_NEAR = 0.15
"""Metres that are added to every distance, so that hands that begin together do not make a giant at once."""
_BAND = float(np.log(1.06))
"""The distance may change by 6 % to and fro, as hands never keep still, before the size follows."""
_EASE = 0.12
"""Seconds in which most of a change is made: what the tracker's noise does in a frame is not seen."""
_STILL = 1.5
"""Seconds for which the hands keep still, after they changed the size, until it stays: a pause is shorter."""
_TOLD = 0.005
"""Part of the size by which it changes until windows are told."""


@dataclass
class _Gesture:
    """One performer's gesture: natural logarithms of the size at its begin and of what it is led to.

    Attributes:
        away: the distance of the hands at the begin, logarithm of metres; None until they are seen.
        still_ns: since when the size has not been led anywhere.
    """

    body: int
    first: float
    away: float | None = None
    led: float = 0.0
    still_ns: int | None = None


class HandSizing:
    """The sizes of the characters on a stage, and the gestures that change them.

    Hands twice as far apart make a character twice as large, between 1 / ``MAX_GROWTH`` and ``MAX_GROWTH``
    of its own size. The size stays as the gesture ends: by the word that began it, or by holding still.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._gestures: dict[str, _Gesture] = {}
        self._told: dict[str, tuple[float, int, float | None]] = {}
        self._time_ns = 0

    def ask(self, order: Resize) -> None:
        """Begins or ends a gesture, sets a size, or how far soft parts swing.

        Raises:
            InputError: where there is no such character or performer, or its size cannot change.
        """
        name, who = self._meant(order)
        actor = self._stage.actors[name]
        if order.do == "exaggerate":
            actor.exaggerate(order.exaggeration)
        elif order.do == "set":
            self._gestures.pop(name, None)
            actor.resize(order.size, self._about(name, None), fade=True)
        elif name in self._gestures:
            del self._gestures[name]
        elif order.do == "hands":
            actor.resize(actor.growth, self._about(name, None))  # is refused where it cannot change
            self._gestures[name] = _Gesture(who, float(np.log(actor.growth)))

    def follow(self, bodies: list[Body], time_ns: int) -> None:
        """Brings the characters to the sizes that the hands of the performers in view mean."""
        seconds, self._time_ns = max(time_ns - self._time_ns, 0) * 1e-9, time_ns
        present = {body.id: body for body in bodies}
        for name, gesture in list(self._gestures.items()):
            actor, body = self._stage.actors.get(name), present.get(gesture.body)
            if actor is None or body is None or _done(gesture, time_ns):
                del self._gestures[name]
                continue
            _lead(gesture, body, time_ns)
            wanted = float(np.clip(gesture.first + gesture.led, -np.log(MAX_GROWTH), np.log(MAX_GROWTH)))
            now = float(np.log(actor.growth))
            now += (wanted - now) * (1.0 - float(np.exp(-seconds / _EASE)))
            actor.resize(float(np.exp(now)), self._about(name, body))

    def changes(self) -> list[SizeMessage]:
        """Returns what windows have not been told yet: sizes that changed, gestures that began or ended."""
        said = []
        for name, actor in self._stage.actors.items():
            gesture = self._gestures.get(name)
            now = actor.growth, -1 if gesture is None else gesture.body, actor.exaggeration
            before = self._told.get(name, (1.0, -1, None))
            moved = abs(now[0] / before[0] - 1.0) > (_TOLD if gesture is not None else 1e-9)
            if moved or now[1:] != before[1:]:
                self._told[name] = now
                said.append(SizeMessage(name, *now))
        for name in self._told.keys() - self._stage.actors.keys():
            del self._told[name]
            said.append(SizeMessage(name, 1.0, -1))
        return said

    def _meant(self, order: Resize) -> tuple[str, int]:
        """Returns the character and the performer that an order is about: who holds it, else who would."""
        stage = self._stage
        name = order.character
        if name is None:
            going = next(iter(self._gestures), None)
            taking = next(iter([*stage.takings("extend"), *stage.takings()]), None)
            name = going or (taking.character if taking else None)
        if name not in stage.actors:
            what = "there is no character" if name is None else f"there is no character {name!r}"
            raise InputError(what, where="sizing", mend=f"Known: {', '.join(stage.actors) or 'none'}.")
        if order.do != "hands" or name in self._gestures:
            return name, -1
        who = stage.candidate(name, "extend")[0] if order.body is None else order.body
        who = stage.first_in_view if who is None else who
        if who is None:
            mend = "Step in front of the sensor first."
            raise InputError("nobody is in view", where=f"sizing {name!r}", mend=mend)
        return name, who

    def _about(self, name: str, body: Body | None) -> Float | None:
        """(3,) metres, the place on the floor that stays: under the performer who holds it; None: its own."""
        actor: Actor = self._stage.actors[name]
        if body is None or all(hold.body != body.id for hold in actor.holds):
            return None
        hip = body.joints[Joint.HIP_CENTER]
        return np.array([hip[0], 0.0, hip[2]]) if np.isfinite(hip).all() else None


def _lead(gesture: _Gesture, body: Body, time_ns: int) -> None:
    """Leads the size by the distance of the hands, with some play between the two."""
    left, right = (body.joints[hand] for hand in _HANDS)
    sure = all(body.confidence[hand] >= _SURE for hand in _HANDS)
    if not (sure and np.isfinite(left).all() and np.isfinite(right).all()):
        return
    away = float(np.log(np.linalg.norm(left - right) + _NEAR))
    if gesture.away is None:
        gesture.away = away
    wanted, before = away - gesture.away, gesture.led
    gesture.led = float(np.clip(before, wanted - _BAND, wanted + _BAND))
    if gesture.led != before:
        gesture.still_ns = time_ns


def _done(gesture: _Gesture, time_ns: int) -> bool:
    """Whether the hands have changed the size, and kept still for long."""
    return gesture.still_ns is not None and (time_ns - gesture.still_ns) * 1e-9 > _STILL
