"""The simulated day: how often each event occurs, and a random schedule of the events.

It is a day of an exhibition with ten opening hours. The soak compresses it by its events: visitors come,
viewers connect and programs fail as often as on such a day, with less time in between. The simulated hours
are determined by the kind of event that is furthest behind. A fault that was skipped therefore does not count
as survived.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from random import Random

DAY_HOURS = 10.0
"""Opening hours of a day."""
MINUTES_PER_DAY = 50.0
"""Minutes of a soak in which the events of one day occur."""
PER_DAY = {
    "visitor in view": 400,
    "viewer connects": 60,
    "character uploaded": 60,
    "possession": 200,
    "sensor fault": 20,
    "sensor hangs": 4,
    "clock jump": 2,
    "full disk": 2,
    "hostile attack": 6,
    "edge killed": 3,
    "viewer killed": 3,
    "health page killed": 3,
}
"""Number of events per day.

One visitor comes every 90 s. The sensor has more than two faults per hour. A real day should have fewer than
three kills of each program.
"""
COUNTED = ("visitor in view",)
"""Kinds that are counted instead of scheduled, because the sensor repeats its crowd."""
RESTARTING = ("sensor hangs", "edge killed", "viewer killed", "health page killed")
"""Kinds that make the supervisor restart a program."""
RESTARTING_SHARE = 0.4
"""Fraction of a soak after which no program is restarted, so that the slope of its memory can be measured."""
LAST_SHARE = 0.92
"""Fraction of a soak after which no event begins, so that the last event ends in time."""


@dataclass(frozen=True)
class Event:
    """One event of the schedule.

    Attributes:
        at_s: seconds after the start of the soak.
        kind: a key of :data:`PER_DAY`.
    """

    at_s: float
    kind: str


def schedule(minutes: float, seed: int) -> list[Event]:
    """Returns the events of a soak in order. Each kind occurs at least once."""
    dice = Random(seed)
    events = []
    for kind, per_day in PER_DAY.items():
        if kind in COUNTED:
            continue
        count = max(1, round(per_day * minutes / MINUTES_PER_DAY))
        # There is one event in each part of the time, so that chance leaves no long part without events.
        share = RESTARTING_SHARE if kind in RESTARTING else LAST_SHARE
        part = 60.0 * minutes * share / count
        events += [Event(part * (number + dice.random()), kind) for number in range(count)]
    return sorted(events, key=lambda event: event.at_s)


def simulated_hours(counts: Mapping[str, int]) -> tuple[float, str]:
    """Returns the simulated hours, and the kind of event that limits them."""
    hours = {kind: DAY_HOURS * counts.get(kind, 0) / per_day for kind, per_day in PER_DAY.items()}
    kind = min(hours, key=lambda each: hours[each])
    return hours[kind], kind
