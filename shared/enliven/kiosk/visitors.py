"""The visitors of a kiosk, and their visits. A visit continues if tracking is lost for a short time or the
tracking id changes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from enliven.kiosk.profile import ZoneSettings
from enliven.person import Body, Joint
from enliven.possession import body_yaw

Place = tuple[float, float]
"""A point of the floor (x, z) in metres."""

MIN_VISITOR_CONFIDENCE = 0.25
"""Minimum mean confidence of a body's joints. Bodies with lower confidence may be furniture or
reflections."""
ZONE_MARGIN_M = 0.25
"""Minimum distance in metres from the zone at which a visitor counts as outside after a visit. Without this
hysteresis, a visitor at the border would enter and leave with every breath."""
MIN_VISIT_MEMORY_S = 1.0
"""Minimum time in seconds for which a lost visitor is remembered. It is longer than typical losses of
tracking."""
_MATCH_RADIUS_M = 0.6
"""Maximum distance in metres between a new id and the visitor who was just lost. It is less than the
distance between two visitors side by side."""
_MATCH_RADIUS_GROWTH_M_S = 1.2
"""Increase of this distance while a visitor is lost, in metres per second."""
_MAX_MATCH_RADIUS_M = 1.5
"""Upper limit of this distance in metres. Beyond it, the new id may as well be another visitor."""


@dataclass(frozen=True)
class Visitor:
    """One tracked person at one moment.

    Attributes:
        id: the tracking id. It may change while the person stays.
        position: position of the hips, projected to the floor. So seated visitors are measured in the same
            way as standing visitors.
        facing: radians about +Y from +Z to the person's front.
        hands: height of the left and the right hand above the shoulder of the same side, as a fraction of the
            arm's length. So it is comparable for adults, children and people in wheelchairs.
        confidence: mean confidence of the joints, 0..1.
        height: height from the soles to the crown when standing, metres.
    """

    id: int
    position: Place
    facing: float = 0.0
    hands: tuple[float, float] = (-1.0, -1.0)
    confidence: float = 1.0
    height: float = 1.7


def visitor_from_body(body: Body) -> Visitor | None:
    """Converts a tracked body to a visitor. Returns None if its hips are unknown."""
    hips = body.joints[Joint.HIP_CENTER]
    if not np.isfinite(hips).all():
        return None
    left = _measure_raised_fraction(body, Joint.SHOULDER_LEFT, Joint.ELBOW_LEFT, Joint.WRIST_LEFT)
    right = _measure_raised_fraction(body, Joint.SHOULDER_RIGHT, Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT)
    height = body.height
    return Visitor(
        body.id,
        (float(hips[0]), float(hips[2])),
        body_yaw(body),
        (left, right),
        float(np.nan_to_num(body.confidence).mean()),
        height if math.isfinite(height) else 1.7,
    )


def _measure_raised_fraction(body: Body, shoulder: Joint, elbow: Joint, wrist: Joint) -> float:
    """Returns the height of a wrist above its shoulder, divided by the arm's length. Returns -1 if it is
    unknown."""
    points = body.joints[[shoulder, elbow, wrist]]
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    if not np.isfinite(length) or length < 1e-3 or body.confidence[wrist] <= 0.0:
        return -1.0
    return float((points[2, 1] - points[0, 1]) / length)


@dataclass
class Visit:
    """The stay of one person, from the first to the last measurement.

    Attributes:
        number: sequence number of the visit, from 1. It does not change if the tracking id changes.
        visitor: the newest measurement.
        in_zone: True while the visitor is in the zone.
        queued_s: time at which the visitor began to wait for a turn, in seconds. Visitors are served in this
            order.
        seen_s: time of the newest measurement, in seconds.
        seen: True if the visitor was measured in the last frame.
    """

    number: int
    visitor: Visitor
    in_zone: bool
    queued_s: float
    seen_s: float
    seen: bool = True

    @property
    def body(self) -> int:
        """Returns the current tracking id."""
        return self.visitor.id

    def distance(self, place: Place) -> float:
        """Returns the distance to a point of the floor in metres."""
        return math.dist(self.visitor.position, place)


class VisitList:
    """The visits in progress.

    Args:
        zone: the zone in which visitors are noticed.
        memory: time in seconds for which the visit of a lost visitor continues.
    """

    def __init__(self, zone: ZoneSettings, memory: float) -> None:
        self._zone, self._memory = zone, max(memory, MIN_VISIT_MEMORY_S)
        self._visits: dict[int, Visit] = {}
        self._last = 0

    @property
    def visits(self) -> Sequence[Visit]:
        """Returns the visits, the oldest first."""
        return tuple(self._visits.values())

    def find(self, number: int | None) -> Visit | None:
        """Returns a visit by its number, or None if it is over."""
        return None if number is None else self._visits.get(number)

    def list_waiting_visits(self) -> list[Visit]:
        """Returns the visits in the zone in the order of their turns."""
        inside = [visit for visit in self._visits.values() if visit.in_zone]
        return sorted(inside, key=lambda visit: (visit.queued_s, visit.number))

    def update(self, now: float, visitors: Iterable[Visitor]) -> None:
        """Updates the visits with the visitors of one frame at ``now`` seconds."""
        present = {v.id: v for v in visitors if _is_usable(v)}
        for visit in self._visits.values():
            visit.seen = visit.body in present
            if visit.seen:
                self._store_measurement(visit, present.pop(visit.body), now)
        self._continue_lost_visits(present, now)
        for visitor in present.values():
            self._last += 1
            inside = self.is_inside(visitor.position)
            self._visits[self._last] = Visit(self._last, visitor, inside, now, now)
        self._visits = {
            number: visit for number, visit in self._visits.items() if now - visit.seen_s <= self._memory
        }

    def clear(self) -> None:
        """Ends all visits."""
        self._visits.clear()

    def is_inside(self, position: Place, margin: float = 0.0) -> bool:
        """Returns True if a point of the floor is in the zone, or at most ``margin`` metres outside."""
        x, z = self._zone.center
        return (
            abs(position[0] - x) <= self._zone.width / 2 + margin
            and abs(position[1] - z) <= self._zone.depth / 2 + margin
        )

    def _continue_lost_visits(self, present: dict[int, Visitor], now: float) -> None:
        """Assigns visitors who appeared near the positions of lost visits to these visits, the nearest pairs
        first."""
        pairs = sorted(
            (visit.distance(visitor.position), visit.number, visitor.id)
            for visit in self._visits.values()
            if not visit.seen
            for visitor in present.values()
            if visit.distance(visitor.position) <= _match_radius(now - visit.seen_s)
        )
        for _, number, body in pairs:
            visit = self._visits[number]
            if not visit.seen and body in present:
                self._store_measurement(visit, present.pop(body), now)

    def _store_measurement(self, visit: Visit, visitor: Visitor, now: float) -> None:
        """Stores a visitor's newest measurement in the visit."""
        visit.visitor, visit.seen_s, visit.seen = visitor, now, True
        inside = self.is_inside(visitor.position, ZONE_MARGIN_M if visit.in_zone else 0.0)
        if inside and not visit.in_zone:
            visit.queued_s = now
        visit.in_zone = inside


def _match_radius(lost_s: float) -> float:
    """Returns the search radius in metres for a visitor who was lost ``lost_s`` seconds ago."""
    return min(_MATCH_RADIUS_M + _MATCH_RADIUS_GROWTH_M_S * lost_s, _MAX_MATCH_RADIUS_M)


def _is_usable(visitor: Visitor) -> bool:
    """Returns True if the confidence of a measurement is high enough for a person."""
    return visitor.confidence >= MIN_VISITOR_CONFIDENCE and all(map(math.isfinite, visitor.position))
