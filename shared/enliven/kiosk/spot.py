"""One spot of a kiosk: the state machine that gives a character to one visitor at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from enliven.kiosk.profile import StorySettings
from enliven.kiosk.story_table import TRANSITIONS, Event, Phase
from enliven.kiosk.visitors import Place, Visit, VisitList

Press = Literal["previous", "next", "take", "leave"]
"""The action of a pressed button: offer the previous or next character, take the character, or give it
back."""

LEAVING_RADIUS_FACTOR = 1.3
"""Factor on the spot's radius at which a visitor leaves the spot. It is above 1, so that swaying does not
empty the ring."""
MAX_RING_HOLD_S = 0.7
"""Time in seconds for which the ring keeps its fill level while the tracker has lost the visitor."""
ANSWER_TIMEOUT_S = 1.5
"""Time in seconds in which the edge must confirm a request. It usually answers within a few frames."""
RING_FRACTION_AFTER_REFUSAL = 0.4
"""Fill level of the ring after the edge has refused. It is not empty, so that the visitor sees that the kiosk
reacts."""
MIN_RAISED_HAND_FRACTION = 0.2
"""Minimum height of a raised hand above its shoulder, as a fraction of the arm's length. The arm need not be
stretched."""
MIN_HAND_RAISED_S = 0.4
"""Time in seconds for which a hand must be raised to change the character. A wave is shorter."""
STEP_ASIDE_RADIUS_FACTOR = 1.4
"""Minimum distance of a step to the side from the centre of the spot, as a factor on its radius."""
CHANGE_REPEAT_INTERVAL_S = 1.4
"""Time in seconds between two changes of the character while a hand stays raised or a visitor stays aside. It
is long enough to look at the character."""
CHOICE_DURATION_S = 3.0
"""Time in seconds from the last change of the character to the end of the choice."""
MIN_OFFER_DISPLAY_S = 1.0
"""Minimum time in seconds for which a newly offered character is shown before the ring fills again."""
NEXT_VISITOR_PRIORITY_S = 6.0
"""Time after a farewell in which only the next visitor in line can take the character, in seconds."""
AWAY_MARGIN_M = 0.5
"""Distance outside the zone, in metres, at which a performing visitor counts as gone. It allows performers to
leave the zone slightly."""
_MAX_RELEASE_GAP_S = 1.0
"""Time in seconds for which the edge may report a character as free before its session ends."""


@dataclass(frozen=True)
class TakeCharacter:
    """A request to the edge: this body takes the character, and all others release it."""

    character: str
    body: int


@dataclass(frozen=True)
class LeaveCharacter:
    """A request to the edge: this body releases the character. None means that everyone releases it."""

    character: str
    body: int | None = None


StoryRequest = TakeCharacter | LeaveCharacter
"""A request to the edge."""


@dataclass(frozen=True)
class SpotInput:
    """The inputs of a spot in one frame.

    Attributes:
        now: time in seconds.
        elapsed: time since the last frame in seconds.
        attendance: the current visits.
        line: the queue: visits in the zone that wait for a turn, in order. Visits at other spots are left
            out.
        presses: button presses for this spot.
        holders: for each character, the tracking ids of the bodies that possess it, as the edge reports.
        free: the characters that can be taken here, in the order of the profile.
    """

    now: float
    elapsed: float
    attendance: VisitList
    line: Sequence[Visit]
    presses: Sequence[Press]
    holders: Mapping[str, tuple[int, ...]]
    free: Sequence[str]


class Spot:
    """The state machine of one spot.

    Args:
        place: centre of the spot on the floor.
        radius: radius of the spot in metres.
        character: the first character that the spot offers.

    Attributes:
        phase: its state.
        character: the character that is offered or possessed here, or empty.
        visit: number of the visit that the spot serves, or None.
        former: during the farewell, number of the visit with the session that has ended.
        ring: fill level of the ring, 0 to 1.
        step: direction of the last change of the character: 1 for the next, -1 for the previous character.
        since_s: time at which the state began, in seconds.
        refusals: number of successive requests that the edge did not confirm.
    """

    def __init__(self, place: Place, radius: float, settings: StorySettings, character: str) -> None:
        self.place, self.radius = place, radius
        self.settings, self.character = settings, character
        self.phase = Phase.ATTRACT
        self.visit: int | None = None
        self.former: int | None = None
        self.ring, self.step, self.since_s = 0.0, 0, 0.0
        self.refusals = 0
        self._requested_s: float | None = None
        self._body = -1
        self._lost_s = self._gone_s = 0.0
        self._changed_s = self._gesture_s = -CHOICE_DURATION_S
        self._raised_s = 0.0
        self._stood: int | None = None
        self._reserved_until = 0.0
        self._retakes = False
        self._requests: list[StoryRequest] = []

    @property
    def is_busy(self) -> bool:
        """Returns True while a visitor possesses the character of this spot, or has requested it."""
        return self.phase is Phase.POSSESSED or self._requested_s is not None

    @property
    def body(self) -> int:
        """Returns the tracking id of the body that must possess the character, or -1 for none."""
        return self._body if self.is_busy else -1

    def elapsed_session(self, now: float) -> float:
        """Returns the time since the visitor took the character, in seconds."""
        return now - self.since_s if self.phase is Phase.POSSESSED else 0.0

    def advance(self, frame: SpotInput) -> list[StoryRequest]:
        """Processes one frame. Returns the requests to the edge."""
        self._requests = []
        if self.phase is Phase.POSSESSED:
            self._advance_performance(frame)
        elif self.phase is Phase.FAREWELL:
            if frame.now - self.since_s >= self.settings.farewell:
                self._reserved_until = frame.now + NEXT_VISITOR_PRIORITY_S
                self._apply_event(Event.FAREWELL_OVER, frame.now)
        else:
            self._advance_without_performer(frame)
        return self._requests

    def take_over_hold(self, character: str, visit: Visit, now: float) -> None:
        """Starts a session for a visitor who possesses the character without a request from here, for
        example after a button press at the edge."""
        self.character, self.visit, self._body = character, visit.number, visit.body
        self._apply_event(Event.HELD, now)

    def lose_edge(self, now: float) -> None:
        """Returns to the initial state, because the connection to the edge is lost."""
        self._apply_event(Event.EDGE_GONE, now)
        self._reserved_until = 0.0

    def expect_return(self) -> None:
        """Stores that the edge may have restarted. If the visitor does not possess the character any more, it
        is requested again."""
        self._retakes = self.phase is Phase.POSSESSED

    # States without a performer: turn to visitors, fill the ring, change the character, request it.

    def _advance_without_performer(self, frame: SpotInput) -> None:
        """Processes a frame of a spot without a performer."""
        if self.character not in frame.free:
            self._offer_character(frame.free[0] if frame.free else "", 0, frame.now)
        if not frame.line and self._requested_s is None:
            self._apply_event(Event.ZONE_EMPTY, frame.now)
            return
        self._apply_event(Event.ENTERED, frame.now)
        candidate = self._find_candidate(frame)
        self._choose_by_buttons(frame)
        self._choose_by_body(frame, candidate)
        if not self.character:
            self.ring, self.visit = 0.0, candidate.number if candidate else None
            return
        self._fill_ring(frame, candidate)
        self._request_character(frame)
        if self.phase is Phase.CHOOSE and frame.now - self._changed_s > CHOICE_DURATION_S:
            self._apply_event(Event.CHOICE_OVER, frame.now)

    def _find_candidate(self, frame: SpotInput) -> Visit | None:
        """Returns the visitor on the spot that may take the character. The current visitor has priority."""
        line = frame.line[:1] if frame.now < self._reserved_until else frame.line
        reach = {v.number: LEAVING_RADIUS_FACTOR if v.number == self.visit else 1.0 for v in line}
        standing = [v for v in line if v.distance(self.place) <= self.radius * reach[v.number]]
        return min(standing, key=lambda v: v.number != self.visit, default=None)

    def _fill_ring(self, frame: SpotInput, candidate: Visit | None) -> None:
        """Fills the ring for the visitor on the spot, or empties it."""
        if self._requested_s is not None:
            return
        if "take" in frame.presses and frame.line:
            nearest = min(frame.line, key=lambda visit: visit.distance(self.place))
            self.visit, self.ring = (candidate or nearest).number, 1.0
            return
        if self.phase is Phase.CHOOSE and frame.now - self._changed_s < MIN_OFFER_DISPLAY_S:
            return
        served = frame.attendance.find(self.visit)
        if candidate is not None:
            if candidate.number != self.visit:
                self.visit, self.ring = candidate.number, 0.0
            self._apply_event(Event.ON_SPOT, frame.now)
            self._stood = candidate.number
            if candidate.seen and self._raised_s == 0.0:
                self.ring = min(self.ring + frame.elapsed / self.settings.dwell, 1.0)
        elif served is None or served.seen or frame.now - served.seen_s > MAX_RING_HOLD_S:
            self.ring = max(self.ring - 2.0 * frame.elapsed / self.settings.dwell, 0.0)
            if self.ring == 0.0:
                self.visit = None
                self._apply_event(Event.OFF_SPOT, frame.now)

    def _request_character(self, frame: SpotInput) -> None:
        """Requests the character when the ring is full, and handles the edge's answer."""
        served = frame.attendance.find(self.visit)
        if self._requested_s is None:
            if self.ring >= 1.0 and served is not None and served.seen:
                self._request_hold(served, frame.now)
            return
        if self._body in frame.holders.get(self.character, ()):
            self.refusals = 0
            self._apply_event(Event.HELD, frame.now)
        elif frame.now - self._requested_s > ANSWER_TIMEOUT_S:
            self.refusals += 1
            self._requests.append(LeaveCharacter(self.character, self._body))
            self._requested_s, self.ring = None, RING_FRACTION_AFTER_REFUSAL
        elif served is not None and served.seen and served.body != self._body:
            self._request_hold(served, frame.now)

    def _request_hold(self, visit: Visit, now: float) -> None:
        """Asks the edge to give the character to a visitor."""
        self.visit, self._body, self._requested_s = visit.number, visit.body, now
        self._requests.append(TakeCharacter(self.character, visit.body))

    # Choice of the character.

    def _choose_by_buttons(self, frame: SpotInput) -> None:
        if self.settings.choose:
            for press in frame.presses:
                if press in ("next", "previous"):
                    self._offer_next_character(1 if press == "next" else -1, frame)

    def _choose_by_body(self, frame: SpotInput, candidate: Visit | None) -> None:
        """Changes the offered character if the served visitor raises a hand or steps to the side."""
        stood = [visit for visit in frame.line if visit.number == self._stood]
        chooser = candidate or next(iter(stood), None)
        if chooser is None or not chooser.seen or self._requested_s is not None:
            self._raised_s = 0.0
            return
        if self.settings.choose == "hand":
            self._choose_by_hand(chooser, frame)
        elif self.settings.choose == "step":
            self._choose_by_step(chooser, frame)

    def _choose_by_hand(self, visit: Visit, frame: SpotInput) -> None:
        left, right = visit.visitor.hands
        if max(left, right) < MIN_RAISED_HAND_FRACTION:
            self._raised_s = 0.0
            return
        self._raised_s += frame.elapsed
        if self._raised_s >= MIN_HAND_RAISED_S and frame.now - self._gesture_s >= CHANGE_REPEAT_INTERVAL_S:
            self._offer_next_character(-1 if left > right else 1, frame)
            self._gesture_s = frame.now

    def _choose_by_step(self, visit: Visit, frame: SpotInput) -> None:
        x, z = visit.visitor.position
        across, along = x - self.place[0], z - self.place[1]
        is_aside = abs(across) >= STEP_ASIDE_RADIUS_FACTOR * self.radius and abs(across) >= abs(along)
        if is_aside and visit.in_zone and frame.now - self._gesture_s >= CHANGE_REPEAT_INTERVAL_S:
            # The picture is mirrored and the visitor faces +Z, so the visitor's left side (+X) is on the left
            # of the picture.
            self._offer_next_character(-1 if across > 0 else 1, frame)
            self._gesture_s = frame.now

    def _offer_next_character(self, step: int, frame: SpotInput) -> None:
        """Offers the next or previous free character."""
        if len(frame.free) < 2 or self.character not in frame.free or self._requested_s is not None:
            return
        choice = (frame.free.index(self.character) + step) % len(frame.free)
        self._offer_character(frame.free[choice], step, frame.now)
        self.ring = 0.0
        self._apply_event(Event.CHARACTER_CHANGED, frame.now)

    def _offer_character(self, character: str, step: int, now: float) -> None:
        self.character, self.step = character, step
        self._changed_s = now

    # States with a performer.

    def _advance_performance(self, frame: SpotInput) -> None:
        """Processes a frame while the visitor possesses the character."""
        visit = frame.attendance.find(self.visit)
        is_here = (
            visit is not None
            and visit.seen
            and frame.attendance.is_inside(visit.visitor.position, AWAY_MARGIN_M)
        )
        self._lost_s = 0.0 if is_here else self._lost_s + frame.elapsed
        if self._requested_s is not None and self._body in frame.holders.get(self.character, ()):
            self._requested_s = None
        if "leave" in frame.presses:
            self._end_session(Event.RELEASED, frame.now)
        elif visit is None or self._lost_s > self.settings.lost:
            self._end_session(Event.LOST, frame.now)
        elif 0 < self.settings.session <= frame.now - self.since_s:
            self._end_session(Event.SESSION_OVER, frame.now)
        elif visit.seen and visit.body != self._body:
            # The tracker has assigned a new id to the visitor, so request the character for this id.
            self._request_hold(visit, frame.now)
        else:
            self._watch_hold(frame, visit)
            self._swap_character(frame, visit)

    def _watch_hold(self, frame: SpotInput, visit: Visit) -> None:
        """Ends the session if the edge has reported for some time that the visitor does not possess the
        character."""
        if self._body in frame.holders.get(self.character, ()):
            self._gone_s, self._retakes = 0.0, False
            return
        self._gone_s += frame.elapsed
        if self._requested_s is not None:
            if frame.now - self._requested_s > ANSWER_TIMEOUT_S:
                self._end_session(Event.RELEASED, frame.now)
        elif self._gone_s > _MAX_RELEASE_GAP_S or self._retakes:
            if self._retakes and visit.seen:
                self._retakes = False
                self._request_hold(visit, frame.now)
            elif not self._retakes:
                self._end_session(Event.RELEASED, frame.now)

    def _swap_character(self, frame: SpotInput, visit: Visit) -> None:
        """Gives the performing visitor another character if a button was pressed."""
        if self.phase is not Phase.POSSESSED or not self.settings.choose or not visit.seen:
            return
        steps = [1 if press == "next" else -1 for press in frame.presses if press in ("next", "previous")]
        others = [self.character, *(name for name in frame.free if name != self.character)]
        if not steps or len(others) < 2 or self._requested_s is not None:
            return
        self._requests.append(LeaveCharacter(self.character, self._body))
        self._offer_character(others[sum(steps) % len(others)], steps[-1], frame.now)
        self._gone_s = 0.0
        self._request_hold(visit, frame.now)

    def _end_session(self, event: Event, now: float) -> None:
        """Ends the session with a farewell."""
        self._requests.append(LeaveCharacter(self.character, self._body))
        self._apply_event(event, now)

    def _apply_event(self, event: Event, now: float) -> None:
        """Changes the state according to the story's table of transitions."""
        following = TRANSITIONS.get((self.phase, event))
        if following is None or following is self.phase:
            return
        self.phase, self.since_s = following, now
        self.former = self.visit if following is Phase.FAREWELL else None
        if following in (Phase.ATTRACT, Phase.FAREWELL):
            self.visit, self._stood, self._body = None, None, -1
        if following is not Phase.DWELL:
            self.ring = 1.0 if following is Phase.POSSESSED else 0.0
        self._requested_s, self._retakes = None, False
        self._lost_s = self._gone_s = self._raised_s = 0.0
