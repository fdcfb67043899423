"""Fuses recorded body streams, and measures the result without ground truth."""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from enliven.arrays import Float
from enliven.frames import BodyFrame
from enliven.person import Body
from enliven.space.space_file import Space
from enliven_edge.fusion.live.fuser import Fuser
from enliven_edge.fusion.live.merge import OutputSchedule, transform_bodies

_LONGEST_STEP = 0.06
"""Longest time between frames for measuring jitter, seconds. Over a longer gap, a change counts as motion."""
_MAX_SAME_PERSON_M = 0.3
"""Maximum distance between a fused body and one sensor's body to compare them as one person, metres."""
_MAX_NEAR_M = 0.02
"""Maximum time between a fused frame and one sensor's frame to compare them, seconds. Less than a frame."""


def jitter_mm(frames: Iterable[BodyFrame]) -> float:
    """Returns the median distance in millimetres of a joint from the straight line between its neighbours in
    time.
    """
    ways: dict[int, list[tuple[int, Float]]] = defaultdict(list)
    for frame in frames:
        for body in frame.bodies:
            ways[body.id].append((frame.time_ns, body.joints))
    deviations = [_line_distances(way) for way in ways.values() if len(way) > 2]
    return 1e3 * float(np.median(np.concatenate(deviations))) if deviations else float("nan")


def _line_distances(way: Sequence[tuple[int, Float]]) -> Float:
    """Returns (N * 20,) metres of each joint from the line between its neighbours, at steady frame times."""
    times = np.array([time for time, _ in way]) * 1e-9
    joints = np.array([body for _, body in way])
    steps = np.diff(times)
    steady = (steps[:-1] < _LONGEST_STEP) & (steps[1:] < _LONGEST_STEP)
    share = (steps[:-1] / (steps[:-1] + steps[1:]))[:, None, None]
    between = joints[:-2] + share * (joints[2:] - joints[:-2])
    return np.asarray(np.linalg.norm(joints[1:-1] - between, axis=2)[steady].ravel())


def agreement(fused: Sequence[BodyFrame], sensor: Sequence[BodyFrame]) -> tuple[float, int]:
    """Returns the distance in millimetres between fused bodies and one sensor's bodies, and the number of
    identity changes.

    Both are in the same world and clock. An identity change is counted if a fused body matches a different
    person of the sensor than before.
    """
    times = np.array([frame.time_ns for frame in sensor])
    apart: list[float] = []
    changes, last = 0, dict[int, int]()
    for frame in fused:
        nearest = int(np.argmin(np.abs(times - frame.time_ns)))
        if abs(int(times[nearest]) - frame.time_ns) > _MAX_NEAR_M * 1e9:
            continue
        for body in frame.bodies:
            other = _partner(body, sensor[nearest].bodies)
            if other is None:
                continue
            apart.append(float(np.linalg.norm(body.joints - other.joints, axis=1).mean()))
            changes += last.get(body.id, other.id) != other.id
            last[body.id] = other.id
    return 1e3 * float(np.mean(apart)) if apart else float("nan"), changes


def _partner(body: Body, others: Sequence[Body]) -> Body | None:
    """Returns the body in ``others`` whose trunk is near this body's trunk, or None."""
    if not others:
        return None
    apart = [float(np.linalg.norm(body.joints[:4] - other.joints[:4], axis=1).mean()) for other in others]
    nearest = int(np.argmin(apart))
    return others[nearest] if apart[nearest] < _MAX_SAME_PERSON_M else None


def fuse_streams(
    streams: Mapping[str, Iterable[BodyFrame]], space: Space, fuser: Fuser
) -> Iterator[BodyFrame]:
    """Yields the fused bodies of recorded body streams, each in its sensor's own level frame and clock.

    Args:
        streams: body streams by sensor of the space.
        fuser: a fuser of the same sensors. Its warnings stay readable for the caller.
    """
    rhythm = OutputSchedule()
    for time_ns, name, frame in heapq.merge(
        *(_frames_on_common_clock(name, frames, space) for name, frames in streams.items()),
        key=lambda entry: entry[0],
    ):
        place = space.sensors[name]
        fuser.update(name, transform_bodies(frame.bodies, place.level), time_ns)
        if rhythm.is_due(name, time_ns):
            yield BodyFrame(fuser.bodies(time_ns), time_ns, "fused")


def _frames_on_common_clock(
    name: str, frames: Iterable[BodyFrame], space: Space
) -> Iterator[tuple[int, str, BodyFrame]]:
    """Yields the frames of one sensor with their time on the common clock."""
    offset = space.sensors[name].clock_offset_ns
    for frame in frames:
        yield frame.time_ns + offset, name, frame
