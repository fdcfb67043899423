"""Tests of the story's invariants for any sequence of visitors, button presses and edge faults."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kiosk_world import STEP_S, Person, Room

from enliven.kiosk.profile import StorySettings, ZoneSettings
from enliven.kiosk.story import Story, find_spot_places
from enliven.kiosk.story_table import Phase

ZONE = ZoneSettings()
X, Z = ZONE.center
LENGTH_S = 40.0
CHARACTERS = ("chair", "lamp", "cactus")
MAX_WAIT_S = 4.0 + 6.0 + 1.5 + 4 * 2.0
"""Longest wait of a person on a free spot, seconds.

It adds the farewell, the turn of another visitor, the ring, and four requests that are lost while the edge
restarts.
"""

times = st.floats(0.0, LENGTH_S, allow_nan=False).map(lambda value: round(value, 1))
places = st.one_of(
    st.sampled_from([(X, Z), (X - 0.75, Z), (X + 0.75, Z), (X + 5.0, Z)]),
    st.tuples(st.floats(X - 2.5, X + 2.5), st.floats(Z - 2.5, Z + 2.5)),
)


@st.composite
def people(draw):
    """Draws a person that wanders, is lost by the tracker, gets new ids, and raises hands."""
    begins = sorted(draw(st.lists(times, min_size=1, max_size=5, unique=True)))
    stops = [(begin, *draw(places)) for begin in begins]
    gaps = [
        (begin, begin + draw(st.sampled_from([0.2, 0.5, 3.0]))) for begin in draw(st.lists(times, max_size=3))
    ]
    hands = [
        (time, draw(st.floats(-1, 1)), draw(st.floats(-1, 1)))
        for time in sorted(draw(st.lists(times, max_size=3)))
    ]
    leaves = draw(st.one_of(st.just(1e9), times))
    return Person(stops, leaves, gaps, sorted(draw(st.lists(times, max_size=2))), hands)


@st.composite
def shows(draw):
    """Draws a room with a kiosk, presses of buttons, and failures of the edge."""
    chosen = StorySettings(
        performers=draw(st.integers(1, 3)),
        choose=draw(st.sampled_from(["", "step", "hand", "button"])),
        session=draw(st.sampled_from([0.0, 6.0, 120.0])),
    )
    room = Room(Story(chosen, ZONE, CHARACTERS), CHARACTERS, draw(st.lists(people(), max_size=4)))
    room.edge.delay = draw(st.integers(0, 8))
    presses = draw(
        st.lists(st.tuples(times, st.sampled_from(["previous", "next", "take", "leave"])), max_size=5)
    )
    outages = draw(st.lists(st.tuples(times, st.sampled_from([0.5, 4.0])), max_size=2))
    return chosen, room, presses, outages


def run(room, presses, outages):
    """Runs a show and yields each view with the state of the room."""
    while room.now < LENGTH_S:
        due = [press for time, press in presses if abs(time - room.now) < STEP_S / 2]
        connected = not any(begin <= room.now < begin + length for begin, length in outages)
        if connected and not room.is_connected:
            room.edge.restart()
        room.is_connected = connected
        yield room.step(*due)


@pytest.mark.slow
@settings(max_examples=60)
@given(shows())
def test_no_character_and_no_visitor_is_given_twice(show):
    _, room, presses, outages = show
    for view in run(room, presses, outages):
        held = [spot for spot in view.spots if spot.phase is Phase.POSSESSED]
        assert len({spot.character for spot in held}) == len(held)
        assert len({spot.visit for spot in held}) == len(held)
        assert len({spot.character for spot in view.spots}) == len(view.spots)
        assert all(len(bodies) <= 1 for bodies in room.edge.holders.values())
        asked = [request.character for request in view.requests if hasattr(request, "body")]
        assert set(asked) <= set(CHARACTERS)


@pytest.mark.slow
@settings(max_examples=60)
@given(shows())
def test_farewell_ends_and_ring_stays_in_range(show):
    chosen, room, presses, outages = show
    since = {}
    for view in run(room, presses, outages):
        for index, spot in enumerate(view.spots):
            assert 0.0 <= spot.ring <= 1.0
            if spot.phase is Phase.FAREWELL:
                since.setdefault(index, room.now)
                assert room.now - since[index] <= chosen.farewell + 2 * STEP_S
            else:
                since.pop(index, None)


@pytest.mark.slow
@settings(max_examples=60)
@given(shows())
def test_empty_room_returns_to_attract_and_frees_the_characters(show):
    chosen, room, presses, outages = show
    for _ in run(room, presses, outages):
        pass
    room.people.clear()
    room.is_connected = True
    room.run(chosen.lost + chosen.farewell + 6.0)
    view = room.step()
    assert view.phase is Phase.ATTRACT
    assert all(spot.phase is Phase.ATTRACT for spot in view.spots)
    assert not any(room.edge.holders.values())


@pytest.mark.slow
@settings(max_examples=60)
@given(shows(), st.booleans())
def test_person_on_a_spot_is_served(show, alone):
    chosen, room, presses, outages = show
    for _ in run(room, presses, outages):
        pass
    room.is_connected = True
    if alone:
        room.people.clear()
    else:
        for person in room.people:
            person.leaves = min(person.leaves, room.now + 1.0)
    spot = find_spot_places(ZONE, min(chosen.performers, len(CHARACTERS)))[0]
    room.people.append(Person([(room.now, *spot)]))
    me = len(room.people)
    end = room.now + MAX_WAIT_S + chosen.lost
    while room.now < end:
        room.step()
        if any(body % 1000 == me for bodies in room.edge.holders.values() for body in bodies):
            return
    raise AssertionError(f"not served: {room.views[-1]}")


@pytest.mark.slow
@settings(max_examples=40)
@given(shows())
def test_story_is_deterministic(show):
    chosen, room, presses, outages = show
    first = list(run(room, presses, outages))
    again = Room(Story(chosen, ZONE, CHARACTERS), CHARACTERS, room.people)
    again.edge.delay = room.edge.delay
    assert list(run(again, presses, outages)) == first
