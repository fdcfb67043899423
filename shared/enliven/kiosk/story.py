"""The story of a kiosk: the state machine that controls the show from visitors, buttons and the edge's
reports.

It is independent of window, clock and network. So tests and simulations can run the same code as an
installation, at any speed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from enliven.kiosk.profile import StorySettings, ZoneSettings
from enliven.kiosk.spot import LeaveCharacter, Press, Spot, SpotInput, StoryRequest, TakeCharacter
from enliven.kiosk.story_table import PHASE_TEXTS, PHASES_BY_PRIORITY, Phase
from enliven.kiosk.visitors import Place, Visit, VisitList, Visitor

MAX_STEP_S = 0.5
"""Maximum time step in seconds. Otherwise, all rings would be full after the computer was suspended."""
MAX_REPORT_DELAY_S = 1.5
"""Time in seconds after a request for which a contradicting report of the edge is ignored."""
ENDING_SOON_S = 10.0
"""Duration in seconds of the last part of a session, in which the remaining time is displayed."""
_SPOT_GAP_M = 0.5
"""Gap in metres between the spots of two performers, so that their arms do not collide."""
_MAX_REFUSALS = 3
"""Number of successive failed requests after which a problem is reported to operators."""


@dataclass(frozen=True)
class StoryInput:
    """The inputs of the story in one frame.

    Attributes:
        now: time in seconds, with any origin. It must not decrease.
        visitors: the tracked people.
        presses: the buttons pressed since the last frame.
        holders: for each character, the tracking ids of the bodies that possess it, as the edge reports.
        available: the characters that are on the edge's stage.
        is_connected: True while the edge and its sensor deliver data.
        playing: the character in the recorded performance that is shown. It is offered to the next visitor
            first. Empty if there is none.
    """

    now: float
    visitors: Sequence[Visitor] = ()
    presses: Sequence[Press] = ()
    holders: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    available: frozenset[str] = frozenset()
    is_connected: bool = True
    playing: str = ""


@dataclass(frozen=True)
class SpotView:
    """The state of one spot, for the display.

    Attributes:
        place: its centre on the floor.
        phase: its state.
        character: the character that is offered or possessed, or empty.
        step: direction of the last change of the character, 1 or -1, or 0 if there was none.
        ring: filling of the ring, 0..1.
        visit: number of the visit that the spot serves, or None.
        body: tracking id of the visitor that the spot serves or that the character turns to, or -1.
        since_s: time at which the state began.
        remaining_s: seconds until the session limit. None without a limit or a session.
    """

    place: Place
    phase: Phase
    character: str
    step: int
    ring: float
    visit: int | None
    body: int
    since_s: float
    remaining_s: float | None


@dataclass(frozen=True)
class StoryView:
    """The output of the story after one frame.

    Attributes:
        phase: the state that is shown.
        title, hint: keys of the texts, or empty.
        sound: the sound that begins in this frame, or empty.
        spots: the spots, from left to right in world coordinates.
        shown: index of the spot that the texts refer to.
        queue: tracking ids of the visitors who wait for a turn, in order.
        requests: requests to the edge.
        problem: one sentence for operators, or empty without a problem.
    """

    phase: Phase
    title: str
    hint: str
    sound: str
    spots: tuple[SpotView, ...]
    shown: int
    queue: tuple[int, ...]
    requests: tuple[StoryRequest, ...]
    problem: str = ""

    @property
    def spot(self) -> SpotView:
        """Returns the spot that the texts refer to."""
        return self.spots[self.shown]


def find_spot_places(zone: ZoneSettings, count: int) -> list[Place]:
    """Returns the centres of the spots of ``count`` performers, side by side about the zone's center."""
    x, z = zone.center
    spacing = 2 * zone.spot + _SPOT_GAP_M
    return [(x + (k - (count - 1) / 2) * spacing, z) for k in range(count)]


class Story:
    """The story of one kiosk.

    Args:
        settings: the durations and options.
        zone: the zone and the spot.
        characters: names of the characters, in the order of the profile. With fewer characters than
            performers, there are as many spots as characters.
    """

    def __init__(self, settings: StorySettings, zone: ZoneSettings, characters: Sequence[str]) -> None:
        self._settings, self._characters = settings, tuple(characters)
        self._attendance = VisitList(zone, settings.lost)
        count = max(min(settings.performers, len(self._characters)), 1)
        self._spots = [
            Spot(place, zone.spot, settings, self._characters[k] if self._characters else "")
            for k, place in enumerate(find_spot_places(zone, count))
        ]
        self._now: float | None = None
        self._gone_s = 0.0
        self._requested: dict[str, float] = {}
        self._phase = Phase.ATTRACT

    def advance(self, frame: StoryInput) -> StoryView:
        """Processes one frame. Returns the state to display and the requests to the edge."""
        elapsed = 0.0 if self._now is None else min(max(frame.now - self._now, 0.0), MAX_STEP_S)
        self._now = frame.now
        requests: list[StoryRequest] = []
        if frame.is_connected:
            if self._gone_s > 0.0:
                for spot in self._spots:
                    spot.expect_return()
            self._gone_s = 0.0
            self._follow_performance(frame)
            self._attendance.update(frame.now, frame.visitors)
            targets = [(press, self._find_target(press)) for press in frame.presses]
            for spot in self._spots:
                presses = [press for press, target in targets if target is spot]
                requests += self._advance_spot(spot, frame, elapsed, presses)
            requests += self._correct_holds(frame)
        else:
            self._gone_s += elapsed
            if self._gone_s > self._settings.lost:
                self._forget_visitors(frame.now)
        for request in requests:
            self._requested[request.character] = frame.now
        return self._create_view(frame, requests)

    def _advance_spot(
        self, spot: Spot, frame: StoryInput, elapsed: float, presses: Sequence[Press]
    ) -> list[StoryRequest]:
        """Processes one frame of a spot. After a session, the visitor is moved to the end of the queue."""
        others = [other for other in self._spots if other is not spot]
        served = {other.visit for other in others if other.visit is not None}
        line = [visit for visit in self._attendance.list_waiting_visits() if visit.number not in served]
        taken_characters = {other.character for other in others}
        free = [name for name in self._characters if name in frame.available and name not in taken_characters]
        performer, was_performing = self._attendance.find(spot.visit), spot.phase is Phase.POSSESSED
        requests = spot.advance(
            SpotInput(frame.now, elapsed, self._attendance, line, presses, frame.holders, free)
        )
        if was_performing and spot.phase is not Phase.POSSESSED and performer is not None:
            performer.queued_s = frame.now
        return requests

    def _follow_performance(self, frame: StoryInput) -> None:
        """Offers the character in the recorded performance, so that visitors get the character that they
        saw."""
        spot = self._spots[0]
        taken_characters = {other.character for other in self._spots[1:]}
        is_free = frame.playing in frame.available and frame.playing not in taken_characters
        if spot.phase is Phase.ATTRACT and is_free and frame.playing in self._characters:
            spot.character = frame.playing

    def _find_target(self, press: Press) -> Spot:
        """Returns the spot that a button acts on. It is a busy spot for "leave", and otherwise a free spot if
        there is one."""
        leaves = press == "leave"
        return next((spot for spot in self._spots if spot.is_busy == leaves), self._spots[0])

    def _correct_holds(self, frame: StoryInput) -> list[StoryRequest]:
        """Handles possessions that were not requested here. Those of visitors become sessions, and all others
        are ended."""
        requests: list[StoryRequest] = []
        for character, bodies in frame.holders.items():
            if character not in self._characters or not bodies:
                continue
            if frame.now - self._requested.get(character, -MAX_REPORT_DELAY_S) < MAX_REPORT_DELAY_S:
                continue
            expected = next((s for s in self._spots if s.is_busy and s.character == character), None)
            if expected is None:
                if not self._adopt_hold(character, bodies, frame.now):
                    requests.append(LeaveCharacter(character))
            elif set(bodies) != {expected.body}:
                requests.append(TakeCharacter(character, expected.body))
        return requests

    def _adopt_hold(self, character: str, bodies: tuple[int, ...], now: float) -> bool:
        """Starts a session on a free spot for the visitor in the zone that possesses a character. Returns
        False if that is not possible."""
        served = {spot.visit for spot in self._spots if spot.visit is not None and spot.is_busy}
        visit = next((v for v in self._attendance.list_waiting_visits() if (v.body,) == tuple(bodies)), None)
        elsewhere = {s.character for s in self._spots if s.is_busy}
        spot = next((s for s in self._spots if not s.is_busy and s.phase is not Phase.FAREWELL), None)
        if visit is None or spot is None or visit.number in served or character in elsewhere:
            return False
        for other in self._spots:
            if other is not spot and other.character == character:
                other.character = spot.character
            if other is not spot and other.visit == visit.number:
                other.visit = None
        spot.take_over_hold(character, visit, now)
        return True

    def _forget_visitors(self, now: float) -> None:
        """Returns to the initial state, because no data about visitors is available."""
        self._attendance.clear()
        for spot in self._spots:
            spot.lose_edge(now)

    def _create_view(self, frame: StoryInput, requests: list[StoryRequest]) -> StoryView:
        spots = tuple(self._spot_view(spot, frame) for spot in self._spots)
        shown = min(range(len(spots)), key=lambda k: PHASES_BY_PRIORITY.index(spots[k].phase))
        served = {spot.visit for spot in self._spots} | {spot.former for spot in self._spots}
        queue = tuple(v.body for v in self._attendance.list_waiting_visits() if v.number not in served)
        phase = spots[shown].phase
        title, hint = self._choose_texts(spots[shown], queue)
        sound = PHASE_TEXTS[phase].sound if phase is not self._phase else ""
        self._phase = phase
        return StoryView(
            phase, title, hint, sound, spots, shown, queue, tuple(requests), self._find_problem(frame)
        )

    def _spot_view(self, spot: Spot, frame: StoryInput) -> SpotView:
        visit = self._attendance.find(spot.visit)
        if visit is None and spot.phase is not Phase.POSSESSED:
            visit = self._find_looked_at(spot)
        remaining = None
        if spot.phase is Phase.POSSESSED and self._settings.session > 0:
            remaining = max(self._settings.session - spot.elapsed_session(frame.now), 0.0)
        body = -1 if visit is None else visit.body
        return SpotView(
            spot.place,
            spot.phase,
            spot.character,
            spot.step,
            spot.ring,
            spot.visit,
            body,
            spot.since_s,
            remaining,
        )

    def _find_looked_at(self, spot: Spot) -> Visit | None:
        """Returns the nearest waiting visitor, to whom the character turns."""
        served = {s.visit for s in self._spots if s.visit is not None}
        waiting = [v for v in self._attendance.list_waiting_visits() if v.number not in served]
        return min(waiting, key=lambda visit: visit.distance(spot.place), default=None)

    def _choose_texts(self, spot: SpotView, queue: tuple[int, ...]) -> tuple[str, str]:
        """Returns the keys of title and hint."""
        texts = PHASE_TEXTS[spot.phase]
        hint = texts.hint
        if spot.phase is Phase.POSSESSED and spot.remaining_s is not None:
            hint = "possessed.ending" if spot.remaining_s <= ENDING_SOON_S else ""
        elif spot.phase is Phase.FAREWELL and queue:
            hint = "farewell.next"
        elif spot.phase in (Phase.NOTICED, Phase.CHOOSE) and len(self._characters) > len(self._spots):
            hint = f"choose.{self._settings.choose}" if self._settings.choose else hint
            hint = "spot" if spot.phase is Phase.NOTICED else hint
        return texts.title, hint

    def _find_problem(self, frame: StoryInput) -> str:
        """Returns a sentence about a problem of the stage for operators, or an empty string."""
        if not frame.is_connected:
            return "the edge or its camera sends no frames"
        missing = [name for name in self._characters if name not in frame.available]
        if missing:
            return f"these characters are not on the stage of the edge: {', '.join(missing)}"
        refusing = [spot.character for spot in self._spots if spot.refusals >= _MAX_REFUSALS]
        return (
            f"the edge refuses the possession of these characters: {', '.join(refusing)}" if refusing else ""
        )
