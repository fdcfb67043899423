"""The health messages: sentence, severity and delay for each kind of trouble."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.health import HealthKind, Severity


@dataclass(frozen=True)
class MessageTemplate:
    """The message of one kind of trouble.

    Attributes:
        severity: how grave it is.
        what, mend: what is wrong and what to do, one sentence each, with the facts in braces.
        raise_after, clear_after: seconds of trouble until it is reported, and without until it is over.
    """

    severity: Severity
    what: str
    mend: str
    raise_after: float = 0.5
    clear_after: float = 1.0


_NOTE, _WARNING, _ERROR = Severity

HEALTH_MESSAGES: dict[HealthKind, MessageTemplate] = {
    HealthKind.NO_FRAMES: MessageTemplate(
        _ERROR,
        "{sensor} has sent no frame for {seconds:.0f} s.",
        "Check its cable and power.",
        0.0,
        0.0,
    ),
    HealthKind.SENSOR_LOST: MessageTemplate(
        _ERROR,
        "{sensor} failed: {why}.",
        "{mend}.",
        0.0,
        0.0,
    ),
    HealthKind.BAD_FRAME: MessageTemplate(
        _WARNING,
        "{sensor} sent a frame that cannot be used: {why}.",
        "If this lasts, calibrate it again, or look for a newer driver.",
        0.0,
        3.0,
    ),
    HealthKind.RESIZED: MessageTemplate(
        _WARNING,
        "{sensor} sent a frame of another size: {why}.",
        "If its mode was changed, wait a moment: the room is learnt anew; else check what else uses it.",
        0.0,
        3.0,
    ),
    HealthKind.FROZEN: MessageTemplate(
        _ERROR,
        "{sensor} sends the same frame again and again.",
        "Unplug it and plug it in again.",
        0.0,
        0.0,
    ),
    HealthKind.SLOW: MessageTemplate(
        _WARNING,
        "{sensor} gives {rate:.0f} frames a second instead of {promised:.0f}.",
        "Use a USB 3 port of its own, or close what else uses this machine.",
    ),
    HealthKind.SLOW_LINK: MessageTemplate(
        _WARNING,
        "{sensor} is connected by {link} only.",
        "Use a USB 3 port and a USB 3 cable; else ask for a smaller image or fewer frames a second.",
        0.0,
        0.0,
    ),
    HealthKind.HOT: MessageTemplate(
        _WARNING,
        "{sensor} has {celsius:.0f} degrees; at {limit:.0f} it stops.",
        "Give it air, or fewer frames a second.",
        5.0,
        10.0,
    ),
    HealthKind.NOT_CALIBRATED: MessageTemplate(
        _WARNING,
        "{sensor} does not know its own lens; a usual one of its kind is used.",
        "Distances may be off by some percent; calibrate it with its maker's tool.",
        0.0,
        0.0,
    ),
    HealthKind.UPSIDE_DOWN: MessageTemplate(
        _ERROR,
        "{sensor} is the other way up than the settings say, by its accelerometer.",
        "Turn it over, or set upside_down under [tracker.scene] in the settings.",
        1.0,
        1.0,
    ),
    HealthKind.NOT_LEVEL: MessageTemplate(
        _WARNING,
        "{sensor} sees a floor that is {degrees:.0f} degrees from what its accelerometer calls level.",
        "Look whether a table or a ramp was taken for the floor; else the accelerometer needs calibrating.",
        3.0,
        3.0,
    ),
    HealthKind.DROPPED: MessageTemplate(
        _WARNING,
        "{percent:.0f} % of the frames are lost on the way.",
        "Use a USB 3 port of its own, a shorter cable, or a smaller image.",
    ),
    HealthKind.OUT_OF_ORDER: MessageTemplate(
        _WARNING,
        "Frames come out of order; {count} were left out so far.",
        "Check the sensor's cable, or what stands between it and this edge.",
        0.0,
        0.0,
    ),
    HealthKind.MOVED: MessageTemplate(
        _WARNING,
        "{sensor} was moved; the room is being learnt anew.",
        "Fix the sensor firmly, and leave its view for a moment.",
        0.0,
        0.0,
    ),
    HealthKind.COVERED: MessageTemplate(
        _ERROR,
        "The lens is covered, or nothing is within the sensor's range.",
        "Uncover the lens, and point it into the room.",
        0.3,
        0.3,
    ),
    HealthKind.MISSING_DEPTH: MessageTemplate(
        _WARNING,
        "{percent:.0f} % of the depth is missing.",
        "Keep sunlight and other depth sensors off the scene, and clean the lens.",
    ),
    HealthKind.LEARNING_ROOM: MessageTemplate(
        _NOTE,
        "The room is still being learnt.",
        "Leave the view for a moment, or step into it from the side.",
        0.2,
        0.0,
    ),
    HealthKind.NO_FLOOR: MessageTemplate(
        _WARNING,
        "No floor is found; the sensor's height and tilt are those of the settings.",
        "Tilt it until it sees the floor, or set height, tilt and upside_down.",
        1.0,
        0.0,
    ),
    HealthKind.TOO_NEAR: MessageTemplate(
        _WARNING, "{performer} is only {metres:.1f} m from the sensor.", "Step back, 1.5 m or more."
    ),
    HealthKind.TOO_FAR: MessageTemplate(
        _WARNING,
        "{performer} is {metres:.1f} m from the sensor, at the end of its range.",
        "Come closer.",
    ),
    HealthKind.CUT_OFF: MessageTemplate(
        _WARNING,
        "{performer} goes beyond the {side} border of the image ({what}).",
        "Step back or to the middle, or turn the sensor.",
        0.7,
    ),
    HealthKind.JOINED: MessageTemplate(
        _WARNING,
        "Performers {names} touch and may be taken for one.",
        "Step apart for a moment.",
    ),
    HealthKind.UNCLEAR: MessageTemplate(
        _WARNING,
        "{performer} is seen too little to be sure of the posture.",
        "Face the sensor, and keep others and furniture out of its view.",
        0.7,
    ),
    HealthKind.TAKE_ENDED: MessageTemplate(
        _WARNING,
        "The take has ended, the show goes on: {why}.",
        "Make room and start the edge with another --record; what was recorded before can be read.",
    ),
    HealthKind.TAKE_GAPS: MessageTemplate(
        _WARNING,
        "{count} messages are not in the take: {why}.",
        "Check the clock of the sensor.",
    ),
}
"""The message of each kind; a test makes sure that every kind has one."""
