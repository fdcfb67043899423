"""The performers of a recording (re-identification): tracks of the same person are merged under one id.

    merge_performers(frames, events) -> MergedPerformers     # enliven.frames.BodyFrame, in order

A tracker that loses a person for some frames often finds them again under another id.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from enliven.arrays import Float
from enliven.frames import BodyFrame
from enliven.person import Body, Joint
from enliven.wire import HoldMessage

_MAX_GAP_S = 3.0
"""Maximum gap, seconds, between two tracks of the same person. Longer absences are mostly exits."""
_SEARCH_RADIUS_M = 1.0
"""Maximum distance, metres, from the place where a person was lost: the tracker's error and one step."""
_WALKING_SPEED_M_PER_S = 1.5
"""Assumed walking speed of a lost person, metres per second."""
_BLEND_NS = 300_000_000
"""Duration, nanoseconds, of the blend from the held pose to the new pose. The blend ends when the person is
found again."""


@dataclass
class MergedPerformers:
    """Frames with one id for each person.

    Attributes:
        frames: in the order of time; a lost person holds still until they are found.
        people: maps each id of the tracker to the person's first id.
    """

    frames: list[BodyFrame]
    people: dict[int, int] = field(default_factory=dict)

    def alone(self, person: int) -> list[BodyFrame]:
        """Returns the frames with only one person."""
        return [replace(f, bodies=[b for b in f.bodies if b.id == person]) for f in self.frames]

    @property
    def person_ids(self) -> list[int]:
        """The ids of all persons in the order of their first appearance."""
        return list(dict.fromkeys(body.id for frame in self.frames for body in frame.bodies))


def merge_performers(frames: Sequence[BodyFrame], events: Iterable[HoldMessage] = ()) -> MergedPerformers:
    """Returns frames in which every person has one id from the first to the last frame.

    A track continues an earlier track if a hold was handed over to it. It also does so if it begins soon
    after the earlier track has ended, near the place where that track ended. If there are several such
    tracks, the nearest is chosen.
    """
    handed = {event.body: event.former for event in events if event.mode == "take over" and event.former >= 0}
    people: dict[int, int] = {}
    last: dict[int, tuple[int, Float]] = {}
    merged: list[BodyFrame] = []
    for frame in frames:
        present = {people[body.id] for body in frame.bodies if body.id in people}
        for body in frame.bodies:
            if body.id not in people:
                people[body.id] = _find_person(body, frame.time_ns, handed, people, last, present)
                present.add(people[body.id])
        bodies = [replace(body, id=people[body.id]) for body in frame.bodies]
        unique = {body.id: body for body in reversed(bodies)}
        merged.append(replace(frame, bodies=list(reversed(unique.values()))))
        last |= {body.id: (frame.time_ns, _floor_position(body)) for body in unique.values()}
    return MergedPerformers(_bridge_losses(merged), people)


def _find_person(
    body: Body,
    time_ns: int,
    handed: dict[int, int],
    people: dict[int, int],
    last: dict[int, tuple[int, Float]],
    present: set[int],
) -> int:
    """Returns the person that a new track belongs to: a lost person, or a new one."""
    former = people.get(handed.get(body.id, -1))
    if former is not None and former not in present:
        return former
    lost = {person: sighting for person, sighting in last.items() if person not in present}
    gaps = {person: (time_ns - seen_ns) * 1e-9 for person, (seen_ns, _) in lost.items()}
    away = {
        person: float(np.linalg.norm(_floor_position(body) - place)) for person, (_, place) in lost.items()
    }
    recent = [person for person, gap in gaps.items() if gap <= _MAX_GAP_S]
    near = [
        person
        for person in recent
        if away[person] <= _SEARCH_RADIUS_M + _WALKING_SPEED_M_PER_S * gaps[person]
    ]
    return min(near, key=lambda person: away[person], default=body.id)


def _floor_position(body: Body) -> Float:
    """Returns (2,) metres, the floor position of a body's hips; far away if it is not known."""
    place = body.joints[Joint.HIP_CENTER, [0, 2]]
    return place if np.isfinite(place).all() else np.full(2, 1e6)


def _bridge_losses(frames: list[BodyFrame]) -> list[BodyFrame]:
    """Adds frames in which each lost person holds still until shortly before they are found again."""
    added: dict[int, list[Body]] = {}
    last_seen: dict[int, tuple[int, Body]] = {}
    for frame in frames:
        for body in frame.bodies:
            since = last_seen.get(body.id)
            if since is not None and frame.time_ns - since[0] > 2 * _BLEND_NS:
                added.setdefault(frame.time_ns - _BLEND_NS, []).append(since[1])
            last_seen[body.id] = frame.time_ns, body
    frames_by_time = {frame.time_ns: frame for frame in frames}
    for time_ns, bodies in added.items():
        frame = frames_by_time.get(time_ns)
        present = [] if frame is None else list(frame.bodies)
        sensor = frames[0].sensor if frame is None else frame.sensor
        frames_by_time[time_ns] = BodyFrame([*present, *bodies], time_ns, sensor)
    return [frames_by_time[time_ns] for time_ns in sorted(frames_by_time)]
