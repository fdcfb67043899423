"""Fuses the bodies of several sensors into one set of bodies."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

from enliven.arrays import Float
from enliven.person import Body
from enliven.rotation import IDENTITY
from enliven_edge.fusion.live.grouping import (
    FORBIDDEN_COST,
    Group,
    body_distances,
    group_by_person,
    solve_assignment_problem,
)
from enliven_edge.fusion.live.person import FusedPerson
from enliven_edge.fusion.live.sensor_view import STATE_SENTENCES, SensorState, SensorView, SensorWarning
from enliven_edge.fusion.settings import MAX_BODY_AGE_S, FusionSettings
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.model import lengths_for_height
from enliven_edge.tracking.body_model.posture import Posture

_SILENCE_S = 1.0
"""Seconds without frames after which a sensor counts as silent: 15 to 30 missing frames."""
_MAX_SAME_PERSON_DISTANCE_M = 0.45
"""Maximum distance in metres between two bodies of one person. Bodies farther apart are different people."""

_GATE_GROWTH = 1.5
"""Growth of an unseen person's maximum matching distance in metres per second, because people may walk on."""
_MOVED_SENSOR_M = 0.2
"""Mean displacement in metres of the people of one sensor for it to count as moved: more than the usual
difference between trackers."""
_MOVED_TIME_CONSTANT_S = 3.0
"""Time constant in seconds of the low-pass of the displacement. It is long, because a short tracking error
must not mark a sensor as moved."""
_DUPLICATE_DISTANCE_M = 0.35
"""Horizontal distance in metres to a person. Within it, a body that fewer sensors see is not a second
person."""


class Fuser:
    """Tracks all people in a space that several sensors watch.

    The input bodies are in world coordinates with times of the common clock, in any order of sensors. Fused
    bodies are available for any moment, usually that of the newest frame. The fuser assigns its own
    identities.

    Args:
        sensor_positions: by sensor, the (3,) position of its lens in metres, world frame.
        settings: the settings. If None, uses the defaults.
    """

    def __init__(self, sensor_positions: Mapping[str, Float], settings: FusionSettings | None = None) -> None:
        self.settings = settings or FusionSettings()
        self.views = [SensorView(name, np.asarray(eye, float)) for name, eye in sensor_positions.items()]
        self.people: list[FusedPerson] = []
        self.warnings: list[SensorWarning] = []
        self._numbers = {view.name: i for i, view in enumerate(self.views)}
        self._next = 1
        self._now_ns: int | None = None

    def update(self, sensor: str, bodies: list[Body], time_ns: int, *, frozen: bool = False) -> bool:
        """Adds a sensor's bodies at a time of the common clock. Returns False if the bodies arrived too
        late.
        """
        view = self.views[self._numbers[sensor]]
        old_state = view.state
        is_new = view.update(bodies, time_ns, _SILENCE_S, frozen=frozen)
        self._add_warning(view, old_state, time_ns)
        return is_new

    def end(self, sensor: str, state: SensorState, time_ns: int) -> None:
        """Marks a sensor as gone: its recording has ended, or it was lost."""
        view = self.views[self._numbers[sensor]]
        old_state, view.state, view.sightings = view.state, state, {}
        self._add_warning(view, old_state, time_ns)

    def bodies(self, time_ns: int) -> list[Body]:
        """Returns all people at a time of the common clock, sorted by identity."""
        s = self.settings
        self._drop_silent_sensors(time_ns)
        groups = group_by_person(self.views, time_ns, MAX_BODY_AGE_S, _MAX_SAME_PERSON_DISTANCE_M, s.loyalty)
        bodies = []
        assign = self._assign_people(groups, time_ns)
        for group, person in assign:
            self._check_placement(group, person, time_ns)
            body = person.fuse(group, self.views, time_ns)
            is_sure = person.hits >= s.sure_after
            duplicate = not is_sure and _is_duplicate(group, [other for other, _ in assign])
            person.hits = 1 if duplicate else person.hits + len(group.sightings)
            if person.hits >= s.sure_after:
                bodies.append(body)
        self._drop_unseen_people(time_ns)
        self._now_ns = time_ns
        return sorted(bodies, key=lambda body: body.id)

    def take_warnings(self) -> list[SensorWarning]:
        """Returns the warnings since the last call."""
        warnings, self.warnings = self.warnings, []
        return warnings

    def _assign_people(self, groups: list[Group], time_ns: int) -> list[tuple[Group, FusedPerson]]:
        """Assigns each group to a known person, or to a new one (data association)."""
        pairs = (
            solve_assignment_problem(self._compute_costs(groups, time_ns)) if groups and self.people else []
        )
        people_by_group = {g: self.people[p] for g, p in pairs}
        recognised_people = []
        for number, group in enumerate(groups):
            person = people_by_group.get(number)
            if person is None:
                person = self._add_person(group)
                self.people.append(person)
            recognised_people.append((group, person))
        return recognised_people

    def _add_person(self, group: Group) -> FusedPerson:
        """Returns a new person, or an earlier one that has returned if the sensors of the group agree on its
        identity.
        """
        identities = [s.person for s in group.sightings.values() if s.person]
        active = {p.id for p in self.people}
        number = max(identities, key=identities.count, default=0)
        if not number or number in active:
            number = self._next
            self._next += 1
        person = FusedPerson(number, len(self.views), self.settings)
        s = self.settings
        if any(p.hits >= s.sure_after for p in self.people):
            # A sensor that was covered may report one person twice for a moment after it sees again. So
            # additional people are confirmed later than the first one.
            person.hits = min(0, s.sure_after - s.sure_beside)
        return person

    def _compute_costs(self, groups: list[Group], time_ns: int) -> Float:
        """Returns (G, P) distances in metres between groups and people.

        They are reduced for groups that were the same person before.
        """
        s = self.settings
        cost = body_distances(
            np.array([g.mean for g in groups]),
            np.array([g.max_confidence for g in groups]),
            np.array([p.predict_joints(time_ns) for p in self.people]),
            np.array([p.confidence for p in self.people]),
        )
        gates = np.array(
            [
                _MAX_SAME_PERSON_DISTANCE_M + _GATE_GROWTH * min(max(p.seconds_unseen(time_ns), 0.0), 1.0)
                for p in self.people
            ]
        )
        votes = np.array([[g.person_fraction(p.id) for p in self.people] for g in groups])
        # If two tracked people turn out to be one person, keep the older identity.
        age = 1e-3 * np.arange(len(self.people))
        max_distance = (cost < gates) | (votes > 0.5)
        return np.where(max_distance, np.minimum(cost, 10.0) - s.loyalty * votes + age, FORBIDDEN_COST)

    def _drop_unseen_people(self, time_ns: int) -> None:
        """Drops people who were not seen for long. Drops unconfirmed people immediately."""
        s = self.settings
        self.people = [
            p
            for p in self.people
            if p.seconds_unseen(time_ns) <= (s.remember if p.hits >= s.sure_after else MAX_BODY_AGE_S)
        ]

    def _drop_silent_sensors(self, time_ns: int) -> None:
        """Marks sensors as silent if they have sent nothing for long."""
        for view in self.views:
            if view.last_ns is None or view.state in (SensorState.ENDED, SensorState.LOST):
                continue
            if time_ns - view.last_ns > _SILENCE_S * 1e9:
                old_state, view.state, view.sightings = view.state, SensorState.SILENT, {}
                self._add_warning(view, old_state, time_ns)

    def _check_placement(self, group: Group, person: FusedPerson, time_ns: int) -> None:
        """Marks a sensor as moved if it has seen people at other positions than the other sensors for a long
        time.
        """
        if len(group.joints) < 2 or self._now_ns is None:
            return
        seconds = max(0.0, (time_ns - self._now_ns) * 1e-9)
        gain = 1.0 - float(np.exp(-seconds / _MOVED_TIME_CONSTANT_S))
        trunks = {n: 0.25 * (j[0] + j[1] + j[2] + j[3]) for n, j in group.joints.items()}
        median = np.median(list(trunks.values()), axis=0) if len(trunks) > 2 else None
        for number, trunk in trunks.items():
            # With three or more sensors, compare with the median, which is right whichever sensor was moved.
            other_trunk = median if median is not None else next(t for n, t in trunks.items() if n != number)
            displacement = trunk - other_trunk
            view = self.views[number]
            view.displacement_m = view.displacement_m + gain * (displacement - view.displacement_m)
            old_state = view.state
            far = float(view.displacement_m @ view.displacement_m) ** 0.5
            if old_state is SensorState.LIVE and far > _MOVED_SENSOR_M:
                view.state = SensorState.MOVED
            elif old_state is SensorState.MOVED and far < 0.5 * _MOVED_SENSOR_M:
                view.state = SensorState.LIVE
            self._add_warning(view, old_state, time_ns)

    def _add_warning(self, view: SensorView, old_state: SensorState, time_ns: int) -> None:
        """Adds a warning about a change of state. The first frame of a sensor gives no warning."""
        if view.state is old_state or (old_state is SensorState.WAITING and view.state is SensorState.LIVE):
            return
        sentence = f"{view.name} {STATE_SENTENCES[view.state]}"
        self.warnings.append(SensorWarning(view.name, view.state, sentence, time_ns))


def _is_duplicate(group: Group, others: list[Group]) -> bool:
    """Returns True if a group is a duplicate of another person: a partial body, or a false detection.

    It is a duplicate if other sensors that see the same place see only one person there. A confirmed person
    is never dropped for this reason, because people may stand close and occlude each other.
    """
    hips = group.mean[0]
    for other in others:
        if other is not group and set(group.sightings) < set(other.sightings):
            distance = (other.mean[0] - hips)[[0, 2]]
            if float(np.hypot(distance[0], distance[1])) < _DUPLICATE_DISTANCE_M:
                return True
    return False


@cache
def warm_up_fusion() -> None:
    """Fuses a few frames of a standing person from two sensors, with orientations, to compile the kernels."""
    fuser = Fuser({"a": np.zeros(3), "b": np.ones(3)})
    rotations = np.tile(IDENTITY, (20, 1))
    for n in range(3):
        for sensor in ("a", "b"):
            fuser.update(
                sensor, [Body(1, make_standing_person() + 1e-3 * n, np.ones(20), rotations)], n * 33_333_333
            )
        fuser.bodies(n * 33_333_333)


def make_standing_person() -> Float:
    """Returns the joints (20, 3) in metres of a standing person."""
    return Posture(np.array([0.0, 0.95, -2.0]), standing_pose(elbow=0.5), lengths_for_height(1.75)).joints()
