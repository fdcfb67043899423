"""A simulated room in front of a kiosk: people, a tracker that loses them, and an edge that answers late."""

from collections import deque
from dataclasses import dataclass, field

from enliven.kiosk.spot import TakeCharacter
from enliven.kiosk.story import Story, StoryInput, StoryView
from enliven.kiosk.visitors import Visitor

STEP_S = 0.1
"""Time step of the simulation in seconds."""


@dataclass
class Person:
    """A person and their position over time.

    Attributes:
        stops: (time, x, z) in seconds and metres. The person jumps from stop to stop without walking.
        leaves: time at which they leave, seconds.
        gaps: (begin, end) intervals in which the tracker loses them, seconds.
        new_ids: times at which the tracker assigns them a new id, seconds.
        hands: (time, left, right): heights of both hands from each time on.
    """

    stops: list[tuple[float, float, float]]
    leaves: float = 1e9
    gaps: list[tuple[float, float]] = field(default_factory=list)
    new_ids: list[float] = field(default_factory=list)
    hands: list[tuple[float, float, float]] = field(default_factory=list)

    def at(self, now: float) -> tuple[float, float] | None:
        """Returns the position (x, z) in metres at a time, None if the person is absent."""
        if now < self.stops[0][0] or now >= self.leaves:
            return None
        _, x, z = [stop for stop in self.stops if stop[0] <= now][-1]
        return x, z

    def visitor(self, now: float, number: int) -> Visitor | None:
        """Returns the tracker's measurement, None if the person is absent or lost by the tracker."""
        place = self.at(now)
        if place is None or any(begin <= now < end for begin, end in self.gaps):
            return None
        swaps = sum(time <= now for time in self.new_ids) + sum(end <= now for _, end in self.gaps)
        raised = [hands for hands in self.hands if hands[0] <= now]
        left, right = raised[-1][1:] if raised else (-1.0, -1.0)
        return Visitor(1000 * swaps + number, place, hands=(left, right))


class SimulatedEdge:
    """Simulates an edge that attaches performers some frames after the request and refuses bodies out of
    view.
    """

    def __init__(self, delay: int = 2) -> None:
        self.holders: dict[str, tuple[int, ...]] = {}
        self.delay, self.refuses = delay, False
        self._orders: deque = deque()

    def take_orders(self, requests, present: set[int]) -> None:
        """Queues requests and executes those that are due."""
        self._orders.append(list(requests))
        if len(self._orders) <= self.delay:
            return
        for request in self._orders.popleft():
            held = self.holders.get(request.character, ())
            if not isinstance(request, TakeCharacter):
                left = [body for body in held if request.body not in (None, body)]
                self.holders[request.character] = tuple(left)
            elif request.body in present and not self.refuses:
                self.holders[request.character] = (request.body,)

    def restart(self) -> None:
        """Clears all attachments and queued requests."""
        self.holders, self._orders = {}, deque()


class Room:
    """A kiosk's story with simulated people, advanced in simulated time.

    Attributes:
        views: the view after each step, with its time.
    """

    def __init__(self, story: Story, characters, people) -> None:
        self.story, self.people = story, list(people)
        self.available, self.edge = frozenset(characters), SimulatedEdge()
        self.now, self.is_connected = 0.0, True
        self.views: list[tuple[float, StoryView]] = []

    def step(self, *presses: str) -> StoryView:
        """Advances by one time step."""
        seen = [person.visitor(self.now, number) for number, person in enumerate(self.people, 1)]
        visitors = [v for v in seen if v is not None] if self.is_connected else []
        view = self.story.advance(
            StoryInput(
                self.now,
                visitors,
                presses,
                dict(self.edge.holders) if self.is_connected else {},
                self.available if self.is_connected else frozenset(),
                self.is_connected,
            )
        )
        if self.is_connected:
            self.edge.take_orders(view.requests, {v.id for v in visitors})
        self.views.append((self.now, view))
        self.now += STEP_S
        return view

    def run(self, seconds: float) -> StoryView:
        """Advances by some seconds and returns the last view."""
        for _ in range(max(round(seconds / STEP_S), 1)):
            view = self.step()
        return view

    def run_until(self, phase: str, at_most: float = 60.0) -> StoryView:
        """Advances until the story is in a phase. Fails if this takes longer than ``at_most`` seconds."""
        end = self.now + at_most
        while self.now < end:
            view = self.step()
            if view.phase == phase:
                return view
        raise AssertionError(f"{phase} did not come within {at_most} s: {view}")
