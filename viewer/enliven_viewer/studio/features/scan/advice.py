"""Chooses the instruction for the person who carries the camera: one sentence in large letters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from enliven.arrays import Float
from enliven.wire import ScanMessage
from enliven_viewer.language import later, tr

Mood = Literal["good", "wait", "bad"]
ADVICE_BOTTOM = 72.0
"""Distance in pixels from the top of the view to the lower end of the instructions."""
_ARRIVAL_ANGLE = 0.35
"""The camera has reached the recommended view if its angle around the object differs by less than this, in
radians (20 degrees).
"""
_OTHER_SIDE_ANGLE = 2.2
"""If the recommended view is farther around the object than this, in radians (126 degrees), the instruction
says "the other side".
"""
_MIN_HEIGHT_DIFFERENCE_M = 0.25
"""Minimum height difference in metres that the instruction mentions."""

_TRACKING_ADVICE = {
    "lost": (later("Lost: go back to where you were before"), "bad"),
    "found": (later("Almost found again: hold still"), "wait"),
    "unsure": (later("This surface is too plain: point the camera at something with corners"), "wait"),
    "empty": (later("The camera sees nothing: go nearer"), "wait"),
}
"""The instruction and mood for each tracking state of the newest image."""


@dataclass(frozen=True)
class Advice:
    """An instruction to show.

    Attributes:
        text: the instruction, shown in large letters.
        mood: "good": continue; "wait": something hinders the scan; "bad": nothing is added.
        arrow: True to show the arrow to the next view.
    """

    text: str
    mood: Mood = "good"
    arrow: bool = False


def choose_advice(message: ScanMessage) -> Advice:
    """Returns the instruction for the person with the camera."""
    if message.phase == "paused":
        return Advice(tr("Paused"), "wait")
    if message.phase == "finishing":
        return Advice(tr("Making the character: a few seconds"), "wait")
    if message.phase == "failed":
        return Advice(message.note or tr("The scan cannot become a character"), "bad")
    if message.phase != "scanning":
        return Advice("")
    if message.thing in ("carried", "settling", "sought", "lost"):
        return Advice(_make_moved_object_advice(message), "wait")
    if message.thing == "person":
        return _choose_person_advice(message)
    if message.tracking in _TRACKING_ADVICE:
        text, mood = _TRACKING_ADVICE[message.tracking]
        return Advice(text, "bad" if mood == "bad" else "wait")
    if message.full:
        return Advice(tr("The scan is full: nothing new is added. Press Done"), "wait")
    if not message.tracking or not message.stage_from_camera:
        return Advice(tr("Point the camera at the object"), "wait")
    if message.thing == "found":
        return Advice(
            tr("Found again in {0:.1f} s: go round the object", max(message.seconds, 0.1)), "good", arrow=True
        )
    if message.thing == "turning":
        return Advice(
            tr("The camera follows the object: keep turning")
            if message.view
            else tr("All sides are scanned: press Done")
        )
    if not message.view:
        return Advice(tr("All sides are scanned: press Done"), "good")
    return Advice(_describe_direction(message), "good", arrow=True)


def _choose_person_advice(status: ScanMessage) -> Advice:
    """Returns the instruction for a person who turns in front of the camera."""
    if status.tracking in ("", "empty"):
        return Advice(tr("Stand 1 to 3 m in front of the camera, with your whole body in view"), "wait")
    if status.tracking != "scanning":
        return Advice(tr("Turn back a little, then continue more slowly"), "wait")
    if status.missing <= 0:
        return Advice(tr("All sides are scanned: stand still"))
    return Advice(tr("Turn slowly on the spot: {0:.0f} % is scanned", 100 * (1 - status.missing)))


def _make_moved_object_advice(status: ScanMessage) -> str:
    """Returns the instruction for a moved object with an unknown pose."""
    if status.thing == "carried":
        return tr("Object lifted or lost: put it down, and go round it")
    if status.thing == "lost":
        return tr("Object not found: turn it back a little, then turn it more slowly")
    if status.thing == "settling":
        return tr("Looking for the object, {0:.0f} s: walk round it slowly", status.seconds)
    return tr("Not found yet: walk on, and show a side that was scanned before")


def _describe_direction(status: ScanMessage) -> str:
    """Returns the instruction towards the recommended view, from the carrier's perspective."""
    camera = np.array(status.stage_from_camera).reshape(3, 4)[:, 3]
    eye, target = np.array(status.view[:3]), np.array(status.view[3:])
    round_it = _find_turn_angle(camera - target, eye - target)
    up = float(eye[1] - camera[1])
    higher = up > _MIN_HEIGHT_DIFFERENCE_M
    height_advice = (
        tr("Hold the camera higher")
        if higher
        else tr("Hold the camera lower")
        if up < -_MIN_HEIGHT_DIFFERENCE_M
        else ""
    )
    if abs(round_it) > _OTHER_SIDE_ANGLE:
        return tr("Walk round to the other side")
    if abs(round_it) > _ARRIVAL_ANGLE:
        # For a person who faces the centre, moving anticlockwise as seen from above is moving to the right.
        side = tr("Walk on to the right") if round_it > 0 else tr("Walk on to the left")
        if not height_advice:
            return side
        return (
            tr("{0}, and hold the camera higher", side)
            if higher
            else tr("{0}, and hold the camera lower", side)
        )
    return height_advice or tr("Good: continue slowly")


def _find_turn_angle(first: Float, second: Float) -> float:
    """Returns the angle about +Y from one direction to another, in radians from -pi to pi."""
    angle = np.arctan2(second[0], second[2]) - np.arctan2(first[0], first[2])
    return float((angle + np.pi) % (2 * np.pi) - np.pi)
