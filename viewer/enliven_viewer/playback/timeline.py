"""A timeline of moments, received or loaded, ordered by the sensor's clock."""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from enliven.arrays import Bool, Float32, Int32
from enliven.document import Character, Pose, Props
from enliven.matching.match_list import MatchList
from enliven.person import Body
from enliven_viewer.playback.interpolation import blend_boards, blend_bodies, blend_poses, blend_props
from enliven_viewer.settings import PlaybackSettings

_MAX_CLOCK_STEP_BACK_S = 1.0
"""If the sensor's clock jumps back by more than this number of seconds, a new timeline starts. Late poses
differ by less.
"""
NS_PER_S = 1_000_000_000
"""Nanoseconds per second, the unit of the sensor's clock."""


@dataclass(frozen=True)
class CueFrame:
    """The pivots of a character that performers control at one time.

    Attributes:
        character: id of the character.
        nodes: (A,) int32 indices of the pivots that are attached to a body.
        strengths: (A,) float32 in [0, 1], strength of the attachment.
        state: "possessed", or "preview" for the pivots that a possession would attach now.
        owners: (A,) ids of the performers who control the pivots; empty if one performer controls all.
        held: number of attached pivots. They precede the previewed pivots. None if ``state`` applies to all
            pivots.
    """

    character: str
    nodes: Int32
    strengths: Float32
    state: str = "possessed"
    owners: Int32 = field(default_factory=lambda: np.empty(0, np.int32))
    held: int | None = None

    @property
    def attached_mask(self) -> Bool:
        """Returns (A,) flags: True for attached pivots, False for previewed ones."""
        every = len(self.nodes) if self.state == "possessed" else 0
        return np.arange(len(self.nodes)) < (every if self.held is None else self.held)


@dataclass(frozen=True)
class TimelineMoment:
    """All values at one time of the sensor's clock: poses, cues and match lists by character, bodies, props.

    ``others`` contains the messages of other topics by topic and key; they are not blended. ``characters``
    contains, for each pose, the revision of its character, if known. ``bodies_ns`` is the time of the bodies.
    Until the bodies of this moment have arrived, it is an earlier time.
    """

    time_ns: int
    poses: dict[str, Pose] = field(default_factory=dict)
    bodies: tuple[Body, ...] = ()
    bodies_ns: int = 0
    cues: dict[str, CueFrame] = field(default_factory=dict)
    props: Props | None = None
    boards: dict[str, MatchList] = field(default_factory=dict)
    others: dict[str, dict[str, Any]] = field(default_factory=dict)
    characters: dict[str, Character] = field(default_factory=dict)

    @property
    def possessed(self) -> bool:
        """Returns True if any character was possessed."""
        return any(cues.state == "possessed" for cues in self.cues.values())


class Timeline:
    """Moments sorted by sensor time. The oldest ones beyond the configured length are dropped.

    If the clock jumps far back, because the edge or a replay was restarted, a new timeline starts.

    Attributes:
        generation: number of timelines that were started.
        posed: ids of all characters that have had a pose.
    """

    def __init__(self, settings: PlaybackSettings | None = None, *, bounded: bool = True) -> None:
        self.settings = settings or PlaybackSettings()
        self.generation = 0
        self._bounded = bounded
        self._times: list[int] = []
        self._moments: list[TimelineMoment] = []
        self._cues: dict[str, CueFrame] = {}
        self.posed: set[str] = set()

    def __len__(self) -> int:
        return len(self._moments)

    @property
    def start_ns(self) -> int:
        """Returns the time of the first moment, or 0 if there is none."""
        return self._times[0] if self._times else 0

    @property
    def end_ns(self) -> int:
        """Returns the time of the last moment, or 0 if there is none."""
        return self._times[-1] if self._times else 0

    def add_pose(self, pose: Pose, character: Character | None = None) -> None:
        """Adds one pose, for a revision of its character, at its time. Replaces an earlier pose
        at this time.
        """
        old_moment = self._moment_near(pose.time_ns)
        self.posed.add(pose.character)
        characters = (
            old_moment.characters
            if character is None
            else {**old_moment.characters, pose.character: character}
        )
        self._insert(
            replace(old_moment, poses={**old_moment.poses, pose.character: pose}, characters=characters)
        )

    def add_bodies(self, time_ns: int, bodies: Sequence[Body]) -> None:
        """Adds the bodies of one time, which replace earlier bodies of the same time."""
        self._insert(replace(self._moment_near(time_ns), bodies=tuple(bodies), bodies_ns=time_ns))

    def add_props(self, props: Props) -> None:
        """Adds the props of one time, which replace earlier props of the same time."""
        self._insert(replace(self._moment_near(props.time_ns), props=props))

    def add_board(self, board: MatchList) -> None:
        """Adds a match list at its time."""
        old_moment = self._moment_near(board.time_ns)
        self._insert(replace(old_moment, boards={**old_moment.boards, board.character: board}))

    def add(self, topic: str, key: str, message: Any) -> None:
        """Adds a message of another topic at its time, and replaces one with the same key and time."""
        old_moment = self._moment_near(message.time_ns)
        topic_messages = {**old_moment.others.get(topic, {}), key: message}
        self._insert(replace(old_moment, others={**old_moment.others, topic: topic_messages}))

    def set_cues(self, cues: CueFrame, time_ns: int | None = None) -> None:
        """Sets the cues of a character from a time on, until they are set again.

        None means from the newest moment on.
        """
        self._cues = {**self._cues, cues.character: cues}
        first = len(self._times) - 1 if time_ns is None else bisect.bisect_left(self._times, time_ns)
        for i in range(max(first, 0), len(self._moments)):
            moment = self._moments[i]
            self._moments[i] = replace(moment, cues={**moment.cues, cues.character: cues})

    def forget_cues(self, character_id: str) -> None:
        """Removes the cues of a character from the newest moment on."""
        self._hold({name: cues for name, cues in self._cues.items() if name != character_id})

    def clear(self) -> None:
        """Removes all moments. The new generation informs the playhead."""
        self._times.clear()
        self._moments.clear()
        self.generation += 1

    def find_moment(self, time_ns: int) -> TimelineMoment | None:
        """Returns the moment at a time, interpolated between its neighbours. In a gap of the recording,
        returns the nearer neighbour. Outside the timeline, returns the first or last moment. Returns None if
        the timeline is empty.
        """
        if not self._moments:
            return None
        right = bisect.bisect_left(self._times, time_ns)
        if right == 0:
            return self._moments[0]
        if right == len(self._moments):
            return self._complete_view_moment(len(self._moments) - 1)
        if self._times[right] == time_ns:
            return self._complete_view_moment(right)
        previous, following = self._moments[right - 1], self._moments[right]
        return self._blend_moments(previous, following, time_ns)

    def neighbour(self, time_ns: int, step: int) -> int:
        """Returns the time of the moment that is ``step`` moments after (or before) a time. At the ends,
        returns the first or last time.
        """
        if not self._times:
            return time_ns
        if step >= 0:
            index = bisect.bisect_right(self._times, time_ns) - 1 + step
        else:
            index = bisect.bisect_left(self._times, time_ns) + step
        return self._times[min(max(index, 0), len(self._times) - 1)]

    def drop_before(self, time_ns: int) -> None:
        """Removes the moments that are not needed for times from ``time_ns`` on."""
        count = max(bisect.bisect_right(self._times, time_ns) - 1, 0)
        del self._times[:count], self._moments[:count]

    def _blend_moments(self, before: TimelineMoment, after: TimelineMoment, time_ns: int) -> TimelineMoment:
        """Returns the interpolated moment between two neighbours."""
        fraction = (time_ns - before.time_ns) / (after.time_ns - before.time_ns)
        if after.time_ns - before.time_ns > self.settings.gap * NS_PER_S:
            return before if fraction < 0.5 else after
        nearer, farther = (before, after) if fraction < 0.5 else (after, before)
        poses, characters = {**farther.poses, **nearer.poses}, {**farther.characters, **nearer.characters}
        for name in before.poses.keys() & after.poses.keys():
            if before.characters.get(name) is after.characters.get(name):
                poses[name] = blend_poses(before.poses[name], after.poses[name], fraction, time_ns)
        bodies = blend_bodies(before.bodies, after.bodies, fraction)
        props = blend_props(before.props, after.props, fraction, time_ns)
        boards = blend_boards(before.boards, after.boards, fraction)
        bodies_ns = nearer.bodies_ns
        return TimelineMoment(
            time_ns, poses, bodies, bodies_ns, before.cues, props, boards, before.others, characters
        )

    def _hold(self, cues: dict[str, CueFrame]) -> None:
        """Sets the cues of the newest moment and of all later ones."""
        self._cues = cues
        if self._moments:
            self._moments[-1] = replace(self._moments[-1], cues=cues)

    def _moment_near(self, time_ns: int) -> TimelineMoment:
        """Returns the moment at exactly this time, or an empty one."""
        index = bisect.bisect_left(self._times, time_ns)
        is_stored = index < len(self._times) and self._times[index] == time_ns
        if is_stored:
            return self._moments[index]
        empty = TimelineMoment(time_ns, cues=self._cues)
        if not index:
            return empty
        # Match lists and bodies arrive later than the poses of the same time. Keep the previous values until
        # then, so that they do not flicker.
        previous = self._moments[index - 1]
        held_moment = replace(empty, props=self._previous_props(index, time_ns), boards=previous.boards)
        if not self._is_fresh(previous.bodies_ns, time_ns):
            return held_moment
        return replace(held_moment, bodies=previous.bodies, bodies_ns=previous.bodies_ns)

    def _complete_view_moment(self, index: int) -> TimelineMoment:
        """Returns a moment, completed with the last known poses of the characters that it lacks.

        This is needed because poses arrive one character after another.
        """
        moment = self._moments[index]
        previous = self._moments[index - 1] if index else moment
        missing_poses = {name: pose for name, pose in previous.poses.items() if name not in moment.poses}
        missing_poses = {
            name: pose for name, pose in missing_poses.items() if self._is_fresh(pose.time_ns, moment.time_ns)
        }
        if not missing_poses:
            return moment
        characters = {**previous.characters, **moment.characters}
        return replace(moment, poses={**missing_poses, **moment.poses}, characters=characters)

    def _is_fresh(self, time_ns: int, now_ns: int) -> bool:
        """Returns True if a time is recent enough that its values are shown until their successors arrive."""
        return 0 <= now_ns - time_ns <= self.settings.gap * NS_PER_S

    def _previous_props(self, index: int, time_ns: int) -> Props | None:
        """Returns the previous moment's props. They stay visible until the moment's own props arrive."""
        props = self._moments[index - 1].props if index else None
        return props if props is not None and self._is_fresh(props.time_ns, time_ns) else None

    def _insert(self, moment: TimelineMoment) -> None:
        """Inserts or replaces a moment.

        Starts a new timeline if the clock went back. Drops the oldest moments beyond the limits.
        """
        if (
            self._times
            and moment.time_ns < self._times[-1] - _MAX_CLOCK_STEP_BACK_S * NS_PER_S
            and self._bounded
        ):
            self.clear()
        index = bisect.bisect_left(self._times, moment.time_ns)
        if index < len(self._times) and self._times[index] == moment.time_ns:
            self._moments[index] = moment
        else:
            self._times.insert(index, moment.time_ns)
            self._moments.insert(index, moment)
        if self._bounded:
            self._trim()

    def _trim(self) -> None:
        """Limits the timeline to the configured duration and number of moments."""
        length = self.settings.minutes * 60
        oldest = self._times[-1] - int(length * NS_PER_S)
        count = max(
            bisect.bisect_left(self._times, oldest), len(self._times) - int(length * self.settings.rate)
        )
        if count > 0:
            del self._times[:count], self._moments[:count]
