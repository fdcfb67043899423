"""Groups the bodies of all sensors by person, and assigns the groups to known people (data association)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.matching.assignment import solve_assignment
from enliven.person import Body
from enliven_edge.fusion.live.blending import bones_within, trunk_distances
from enliven_edge.fusion.live.sensor_view import BodySighting, SensorView
from enliven_edge.fusion.live.side_assignment import MIDLINE_JOINTS

FORBIDDEN_COST = 1e3
"""Cost in metres of a forbidden pairing: above every distance in a room."""
_BONES = np.array([(0, 2), (2, 3), (12, 13), (16, 17), (13, 14), (17, 18)])
"""(6, 2) joints of the bones that are measured: trunk, neck and head, thighs and shanks."""
_MIN_BONE_LENGTHS_M = np.array([0.15, 0.05, 0.1, 0.1, 0.1, 0.1])
"""(6,) minimum lengths in metres of a person's bones in ``_BONES``."""
_MAX_BONE_LENGTHS_M = np.array([0.9, 0.5, 0.8, 0.8, 0.8, 0.8])
"""(6,) maximum lengths in metres of a person's bones in ``_BONES``. They are generous, because a guessed
joint may be wrong."""


@dataclass
class Group:
    """The bodies of one person at one moment.

    Attributes:
        sightings: the body of each sensor, by the sensor's number.
        joints: by the sensor's number, (20, 3) joints in metres, predicted to this moment.
    """

    sightings: dict[int, BodySighting] = field(default_factory=dict)
    joints: dict[int, Float] = field(default_factory=dict)

    def add(self, sensor: int, sighting: BodySighting, joints: Float) -> None:
        """Adds the body of one more sensor."""
        self.sightings[sensor], self.joints[sensor] = sighting, joints

    @property
    def mean(self) -> Float:
        """Returns the unweighted mean (20, 3) of the joints."""
        return np.asarray(sum(self.joints.values()) / len(self.joints))

    @property
    def max_confidence(self) -> Float:
        """Returns the maximum confidence (20,) of each joint over the sensors."""
        return np.max([s.body.confidence for s in self.sightings.values()], axis=0)

    def person_fraction(self, person: int) -> float:
        """Returns the fraction of the group's bodies that belonged to this person in the last update."""
        return sum(s.person == person for s in self.sightings.values()) / len(self.sightings)


def is_plausible(body: Body) -> bool:
    """Returns True if a body may belong to a person. A tracker that lost a person may deliver collapsed
    joints.
    """
    return bool(bones_within(body.joints, _BONES, _MIN_BONE_LENGTHS_M, _MAX_BONE_LENGTHS_M))


def body_distances(a: Float, a_sure: Float, b: Float, b_sure: Float) -> Float:
    """Returns (A, B) distances in metres between bodies (A, 20, 3) and (B, 20, 3).

    The distance does not change if left and right are exchanged.
    """
    result = np.empty((len(a), len(b)))
    trunk_distances(a, a_sure, b, b_sure, MIDLINE_JOINTS, result)
    return result


def group_by_person(
    views: list[SensorView], time_ns: int, patience: float, gate: float, loyalty: float
) -> list[Group]:
    """Groups the bodies of all sensors by person, at most one body of each sensor.

    Sensors are added one after another, starting with those that see most people. Bodies that were one person
    in the last update stay together, unless another body is clearly nearer. So if a sensor confuses two
    people, they keep their identities. A body that its sensor only predicts, because the person is hidden, is
    dropped if another sensor sees that person.

    Args:
        views: the sensors.
        time_ns: the moment, on the common clock.
        patience: maximum age of a body in seconds.
        gate: maximum distance in metres of two bodies of one person.
        loyalty: advantage in metres of the previous assignment.
    """
    recent = [[s for s in view.sightings.values() if s.age(time_ns) <= patience] for view in views]
    sorted_views = {s.person for sightings in recent for s in sightings if s.body.confidence.any()}
    current = [
        [
            (s, s.joints(time_ns, patience))
            for s in sightings
            if is_plausible(s.body) and (s.body.confidence.any() or s.person not in sorted_views)
        ]
        for sightings in recent
    ]
    groups: list[Group] = []
    for sensor in sorted(range(len(views)), key=lambda v: (-len(current[v]), v)):
        candidates = current[sensor]
        partners = _find_partners(groups, candidates, gate, loyalty) if groups and candidates else {}
        for number, (sighting, joints) in enumerate(candidates):
            group = partners.get(number)
            if group is None:
                group = Group()
                groups.append(group)
            group.add(sensor, sighting, joints)
    return groups


def _find_partners(
    groups: list[Group], seen: list[tuple[BodySighting, Float]], gate: float, loyalty: float
) -> dict[int, Group]:
    """Returns the group of each body of one sensor, by the body's index. Bodies without a near group are left
    out.
    """
    group_distances = body_distances(
        np.array([g.mean for g in groups]),
        np.array([g.max_confidence for g in groups]),
        np.array([joints for _, joints in seen]),
        np.array([s.body.confidence for s, _ in seen]),
    )
    previous_group = np.array(
        [[g.person_fraction(s.person) if s.person else 0.0 for s, _ in seen] for g in groups]
    )
    return {
        n: groups[g]
        for g, n in solve_assignment_problem(
            np.where(group_distances < gate, group_distances - loyalty * previous_group, FORBIDDEN_COST)
        )
    }


def solve_assignment_problem(cost: Float) -> list[tuple[int, int]]:
    """Returns the cheapest assignment of rows to columns (Hungarian algorithm).

    Entries of :data:`FORBIDDEN_COST` stay unassigned.
    """
    if not cost.size:
        return []
    rows, columns = solve_assignment(cost)
    return [(int(r), int(c)) for r, c in zip(rows, columns, strict=True) if cost[r, c] < FORBIDDEN_COST / 2]
