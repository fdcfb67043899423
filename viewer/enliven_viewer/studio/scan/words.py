"""What a person who carries the camera is told: one sentence that is read from three metres away."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from enliven.arrays import Float
from enliven.wire import ScanMessage
from enliven_viewer.language import later, tr

_BESIDE = 0.35
"""Radians round the thing, 20 degrees, within which a camera stands where it is wanted."""
_BEHIND = 2.2
"""Radians round the thing from which on the other side is meant, 126 degrees."""
_HIGHER = 0.25
"""Metres of height that are worth a word."""

_TRACKED = {
    "lost": (later("Lost: go back to where you were"), "bad"),
    "found": (later("Lost: hold still, it looks right"), "wait"),
    "unsure": (later("Show it something with corners: this surface is too plain"), "wait"),
    "empty": (later("Go nearer: nothing is seen"), "wait"),
}
"""What is said by what became of the newest image."""


@dataclass(frozen=True)
class Advice:
    """What is said.

    Attributes:
        text: in large letters.
        mood: "good": go on; "wait": something hinders; "bad": nothing is added.
        arrow: whether the arrow to the next view belongs to it.
    """

    text: str
    mood: Literal["good", "wait", "bad"] = "good"
    arrow: bool = False


def advice_of(said: ScanMessage) -> Advice:
    """Returns what to tell the person with the camera."""
    if said.phase == "paused":
        return Advice(tr("Paused"), "wait")
    if said.phase == "finishing":
        return Advice(tr("It becomes a character: some seconds"), "wait")
    if said.phase == "failed":
        return Advice(said.note or tr("It cannot be made"), "bad")
    if said.phase != "scanning":
        return Advice("")
    if said.thing in ("carried", "settling", "sought", "lost"):
        return Advice(_moved(said), "wait")
    if said.thing == "person":
        return _person(said)
    if said.tracking in _TRACKED:
        text, mood = _TRACKED[said.tracking]
        return Advice(text, "bad" if mood == "bad" else "wait")
    if said.full:
        return Advice(tr("It is full: nothing new is added. Press Done"), "wait")
    if not said.tracking or not said.stage_from_camera:
        return Advice(tr("Point the camera at the thing"), "wait")
    if said.thing == "found":
        return Advice(tr("Found again in {0:.1f} s: go round it", max(said.seconds, 0.1)), "good", arrow=True)
    if said.thing == "turning":
        return Advice(tr("It is followed: go on turning it") if said.view else tr("All round: press Done"))
    if not said.view:
        return Advice(tr("All round: press Done"), "good")
    return Advice(_way(said), "good", arrow=True)


def _person(said: ScanMessage) -> Advice:
    """Returns what to tell a person who turns before the camera."""
    if said.tracking in ("", "empty"):
        return Advice(tr("Stand one to three metres before the camera, whole in view"), "wait")
    if said.tracking != "scanning":
        return Advice(tr("Turn back a little, then on, more slowly"), "wait")
    if said.missing <= 0:
        return Advice(tr("All round: stand still"))
    return Advice(tr("Turn on the spot, slowly: {0:.0f} of 100", 100 * (1 - said.missing)))


def _moved(said: ScanMessage) -> str:
    """Returns what to do with a thing of which it is not known where it lies."""
    if said.thing == "carried":
        return tr("Taken up, or lost: lay it down, and go round it")
    if said.thing == "lost":
        return tr("It is not found: turn it back a little, and more slowly")
    if said.thing == "settling":
        return tr("It is looked for, {0:.0f} s: walk round it slowly", said.seconds)
    return tr("Not found yet: walk on, show what was seen before")


def _way(said: ScanMessage) -> str:
    """Returns where the camera is wanted, as seen by the person who carries it."""
    camera = np.array(said.stage_from_camera).reshape(3, 4)[:, 3]
    eye, target = np.array(said.view[:3]), np.array(said.view[3:])
    round_it = _about(camera - target, eye - target)
    up = float(eye[1] - camera[1])
    higher = up > _HIGHER
    held = tr("Hold it higher") if higher else tr("Hold it lower") if up < -_HIGHER else ""
    if abs(round_it) > _BEHIND:
        return tr("Walk round to the other side")
    if abs(round_it) > _BESIDE:
        # Anticlockwise from above is to the right of one who looks at the middle.
        side = tr("Walk on to the right") if round_it > 0 else tr("Walk on to the left")
        if not held:
            return side
        return tr("{0}, and hold it higher", side) if higher else tr("{0}, and hold it lower", side)
    return held or tr("Good: go on slowly")


def _about(one: Float, other: Float) -> float:
    """Returns the radians about +Y, -pi to pi, from a direction to another."""
    angle = np.arctan2(other[0], other[2]) - np.arctan2(one[0], one[2])
    return float((angle + np.pi) % (2 * np.pi) - np.pi)
