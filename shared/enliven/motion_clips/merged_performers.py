"""Re-identifies the performers in a recording: merges the tracks of the same person under one id.

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
"""Maximum gap, seconds, between two tracks of the same person. If the absence is longer, the person has
usually left."""
_SEARCH_RADIUS_M = 1.0
"""Maximum distance, metres, between the positions at which a person is lost and found again. It allows for
the tracker's error and one step."""
_WALKING_SPEED_M_PER_S = 1.5
"""Assumed walking speed of a lost person, metres per second."""
_BLEND_NS = 300_000_000
"""Duration, nanoseconds, of the blend from the last known pose to the new pose. The blend ends when the
person is found again."""


@dataclass
class MergedPerformers:
    """Frames of a recording in which each person has a single id.

    Attributes:
        frames: the frames in the order of time. A lost person stays in the last known pose until the person
            is found again.
        people: maps each id of the tracker to the person's first id.
    """

    frames: list[BodyFrame]
    people: dict[int, int] = field(default_factory=dict)

    def select_person_frames(self, person: int) -> list[BodyFrame]:
        """Returns the frames with all other people removed."""
        return [replace(f, bodies=[b for b in f.bodies if b.id == person]) for f in self.frames]

    @property
    def person_ids(self) -> list[int]:
        """The ids of all persons in the order of their first appearance."""
        return list(dict.fromkeys(body.id for frame in self.frames for body in frame.bodies))


def merge_performers(frames: Sequence[BodyFrame], events: Iterable[HoldMessage] = ()) -> MergedPerformers:
    """Merges tracks, so that every person has one id from the first to the last frame.

    A track continues an earlier track if the earlier track's attachment was transferred to it ("take over").
    It also continues a track that ended shortly before at nearly the same position. Of several such tracks,
    the nearest is chosen.
    """
    handed = {event.body: event.former for event in events if event.mode == "take over" and event.former >= 0}
    people: dict[int, int] = {}
    last_sightings: dict[int, tuple[int, Float]] = {}
    merged_frames: list[BodyFrame] = []
    for frame in frames:
        present = {people[body.id] for body in frame.bodies if body.id in people}
        for body in frame.bodies:
            if body.id not in people:
                people[body.id] = _find_person(body, frame.time_ns, handed, people, last_sightings, present)
                present.add(people[body.id])
        bodies = [replace(body, id=people[body.id]) for body in frame.bodies]
        unique = {body.id: body for body in reversed(bodies)}
        merged_frames.append(replace(frame, bodies=list(reversed(unique.values()))))
        last_sightings |= {body.id: (frame.time_ns, _floor_position(body)) for body in unique.values()}
    return MergedPerformers(_bridge_losses(merged_frames), people)


def _find_person(
    body: Body,
    time_ns: int,
    handed: dict[int, int],
    people: dict[int, int],
    last: dict[int, tuple[int, Float]],
    present: set[int],
) -> int:
    """Returns the id of the person that a new track belongs to. This may be a lost person or a new person."""
    handed_person = people.get(handed.get(body.id, -1))
    if handed_person is not None and handed_person not in present:
        return handed_person
    lost = {person: sighting for person, sighting in last.items() if person not in present}
    gaps = {person: (time_ns - seen_ns) * 1e-9 for person, (seen_ns, _) in lost.items()}
    distances = {
        person: float(np.linalg.norm(_floor_position(body) - last_position))
        for person, (_, last_position) in lost.items()
    }
    recent = [person for person, gap in gaps.items() if gap <= _MAX_GAP_S]
    reachable = [
        person
        for person in recent
        if distances[person] <= _SEARCH_RADIUS_M + _WALKING_SPEED_M_PER_S * gaps[person]
    ]
    return min(reachable, key=lambda person: distances[person], default=body.id)


def _floor_position(body: Body) -> Float:
    """Returns the position (2,) of a body's hips on the floor, metres. If it is unknown, returns a position
    far away."""
    position = body.joints[Joint.HIP_CENTER, [0, 2]]
    return position if np.isfinite(position).all() else np.full(2, 1e6)


def _bridge_losses(frames: list[BodyFrame]) -> list[BodyFrame]:
    """Adds each lost person to the frames of the gap, in the last known pose until shortly before the person
    is found again.
    """
    added: dict[int, list[Body]] = {}
    last_seen: dict[int, tuple[int, Body]] = {}
    for frame in frames:
        for body in frame.bodies:
            last_frame = last_seen.get(body.id)
            if last_frame is not None and frame.time_ns - last_frame[0] > 2 * _BLEND_NS:
                added.setdefault(frame.time_ns - _BLEND_NS, []).append(last_frame[1])
            last_seen[body.id] = frame.time_ns, body
    frames_by_time = {frame.time_ns: frame for frame in frames}
    for time_ns, bodies in added.items():
        frame = frames_by_time.get(time_ns)
        present = [] if frame is None else list(frame.bodies)
        sensor = frames[0].sensor if frame is None else frame.sensor
        frames_by_time[time_ns] = BodyFrame([*present, *bodies], time_ns, sensor)
    return [frames_by_time[time_ns] for time_ns in sorted(frames_by_time)]
