"""Tests of the story of a kiosk with visitors of all kinds, in simulated time."""

from dataclasses import replace

import pytest
from kiosk_world import Person, Room

from enliven.kiosk.profile import StorySettings, ZoneSettings
from enliven.kiosk.spot import TakeCharacter
from enliven.kiosk.story import Story
from enliven.kiosk.story_table import Phase

ZONE = ZoneSettings()
X, Z = ZONE.center
SETTINGS = StorySettings()


def make_room(*people, characters=("chair",), **settings) -> Room:
    """Returns a room with a kiosk and people."""
    return Room(Story(replace(SETTINGS, **settings), ZONE, characters), characters, people)


def on_spot(begin: float = 1.0, **more) -> Person:
    """Returns a person that stands on the spot from time ``begin`` on."""
    return Person([(begin, X, Z)], **more)


def test_visitor_on_spot_gets_character_after_dwell():
    room = make_room(on_spot())
    assert room.run(0.9).phase == Phase.ATTRACT
    room.run_until("dwell", 0.4)
    began = room.now
    view = room.run_until("possessed", 3.0)
    assert SETTINGS.dwell <= room.now - began <= SETTINGS.dwell + 0.6
    assert room.edge.holders == {"chair": (1,)}
    assert view.spot.body == 1


def test_ring_fills_and_empties():
    room = make_room(Person([(0.0, X, Z), (1.0, X + 1.2, Z)]))
    assert 0.5 < room.run(1.0).spot.ring < 0.8
    view = room.run(1.0)
    assert view.spot.ring == 0.0
    assert view.phase == Phase.NOTICED


def test_bystander_outside_of_zone_is_ignored():
    room = make_room(Person([(0.0, X + ZONE.width, Z)]))
    assert {room.step().phase for _ in range(100)} == {Phase.ATTRACT}


def test_furniture_is_not_noticed():
    story = Story(SETTINGS, ZONE, ["chair"])
    room = Room(story, ["chair"], [on_spot(0.0)])
    room.people[0].visitor = lambda now, number, real=room.people[0].visitor: replace(
        real(now, number), confidence=0.1
    )
    assert room.run(5.0).phase == Phase.ATTRACT


def test_flicker_with_new_id_keeps_session():
    room = make_room(on_spot(gaps=[(6.0, 6.5)]))
    room.run_until("possessed")
    room.run(8.0)
    assert {view.phase for now, view in room.views if now > 4.0} == {Phase.POSSESSED}
    assert room.edge.holders["chair"] == (1001,)


def test_flicker_while_dwelling_keeps_ring():
    room = make_room(on_spot(0.0, gaps=[(1.0, 1.5)]))
    room.run(1.5)
    assert room.views[-1][1].spot.ring > 0.5
    room.run_until("possessed", 2.0)


def test_lost_visitor_gets_farewell_then_attract():
    room = make_room(on_spot(leaves=8.0))
    room.run_until("possessed")
    room.run_until("farewell", 12.0)
    assert room.now <= 8.0 + SETTINGS.lost + 0.5
    assert not room.edge.holders["chair"] or room.run(0.5).phase == Phase.FAREWELL
    room.run_until("attract", SETTINGS.farewell + 0.5)
    assert room.edge.holders["chair"] == ()


def test_session_limit_ends_with_next_in_line():
    room = make_room(on_spot(0.0), Person([(2.0, X + 0.9, Z + 0.9)]), session=10.0)
    room.run_until("possessed")
    view = room.run_until("farewell", 12.0)
    assert view.hint == "farewell.next"
    assert view.queue == (2,)


def test_next_in_line_comes_before_the_former_visitor():
    second = Person([(2.0, X + 0.9, Z + 0.9), (15.5, X + 0.1, Z)])
    room = make_room(on_spot(0.0), second, session=10.0)
    room.run_until("farewell", 14.0)
    room.run_until("possessed", 12.0)
    assert room.edge.holders["chair"] == (2,)


def test_former_visitor_gets_another_turn_if_nobody_else_wants():
    room = make_room(on_spot(0.0), Person([(2.0, X + 0.9, Z + 0.9)]), session=10.0)
    room.run_until("farewell", 14.0)
    room.run_until("possessed", 20.0)
    assert room.edge.holders["chair"] == (1,)


def test_remaining_time_is_shown_near_the_end():
    room = make_room(on_spot(0.0), session=20.0)
    room.run_until("possessed")
    assert room.run(1.0).hint == ""
    view = room.run(11.0)
    assert view.hint == "possessed.ending"
    assert 5 < view.spot.remaining_s < 10


def test_step_aside_changes_the_character():
    stops = [(0.0, X, Z), (0.6, X - 0.9, Z)]
    room = make_room(Person(stops), characters=("chair", "lamp", "cactus"))
    room.run(0.5)
    view = room.run_until("choose", 1.0)
    assert view.spot.character == "lamp"
    assert view.hint == "choose.step"
    room.run(1.5)
    assert room.views[-1][1].spot.character == "cactus", "staying aside goes on to the next one"


def test_step_to_the_left_goes_back():
    room = make_room(Person([(0.0, X, Z), (0.6, X + 0.9, Z)]), characters=("chair", "lamp", "cactus"))
    room.run(0.5)
    assert room.run_until("choose", 1.0).spot.character == "cactus"


def test_walking_past_the_spot_changes_nothing():
    room = make_room(Person([(0.0, X + 1.2, Z), (1.0, X - 1.2, Z)]), characters=("chair", "lamp"))
    assert room.run(4.0).spot.character == "chair"


@pytest.mark.parametrize(("left", "right", "character"), [(0.5, -1.0, "cactus"), (-1.0, 0.5, "lamp")])
def test_raised_hand_changes_the_character(left, right, character):
    person = on_spot(0.0, hands=[(0.5, left, right), (1.5, -1.0, -1.0)])
    room = make_room(person, characters=("chair", "lamp", "cactus"), choose="hand")
    assert room.run_until("choose", 2.0).spot.character == character
    room.run_until("possessed", 5.0)
    assert room.edge.holders[character] == (1,)


def test_raised_hand_while_performing_changes_nothing():
    person = on_spot(0.0, hands=[(4.0, 0.9, 0.9)])
    room = make_room(person, characters=("chair", "lamp"), choose="hand")
    room.run(10.0)
    assert room.edge.holders == {"chair": (1,)}


def test_buttons_alone_are_enough():
    room = make_room(Person([(0.0, X + 1.2, Z + 1.0)]), characters=("chair", "lamp"), choose="button")
    room.run(1.0)
    assert room.step("next").spot.character == "lamp"
    room.run(0.5)
    room.step("take")
    room.run(0.5)
    assert room.edge.holders == {"lamp": (1,)}
    room.step("next")
    room.run(0.5)
    assert room.edge.holders == {"lamp": (), "chair": (1,)}
    assert room.step("leave").phase == Phase.FAREWELL
    room.run(0.5)
    assert room.edge.holders["chair"] == ()


def test_choice_can_be_turned_off():
    room = make_room(on_spot(0.0), characters=("chair", "lamp"), choose="")
    room.run(0.5)
    assert room.step("next").spot.character == "chair"


def test_duet_gives_each_visitor_a_character():
    left, right = Person([(0.0, X - 0.75, Z)]), Person([(0.5, X + 0.75, Z)])
    room = make_room(left, right, characters=("chair", "lamp"), performers=2)
    room.run(5.0)
    assert room.edge.holders == {"chair": (1,), "lamp": (2,)}
    assert [spot.phase for spot in room.views[-1][1].spots] == [Phase.POSSESSED] * 2


def test_more_performers_than_characters_get_as_many_spots():
    assert len(make_room(performers=4, characters=("chair", "lamp")).run(0.2).spots) == 2


def test_lost_edge_returns_to_attract_without_words():
    room = make_room(on_spot(0.0))
    room.run_until("possessed")
    room.is_connected = False
    room.run(SETTINGS.lost + 0.5)
    assert room.views[-1][1].phase == Phase.ATTRACT
    assert "farewell" not in {view.phase for _, view in room.views}
    assert room.views[-1][1].problem
    room.is_connected = True
    room.edge.restart()
    room.run_until("possessed", 5.0)


def test_short_loss_of_the_link_keeps_the_session():
    room = make_room(on_spot(0.0))
    room.run_until("possessed")
    room.is_connected = False
    room.run(1.0)
    room.is_connected = True
    room.edge.restart()
    room.run(3.0)
    assert room.edge.holders == {"chair": (1,)}
    assert "farewell" not in {view.phase for _, view in room.views}


def test_refusing_edge_is_asked_again_and_reported():
    room = make_room(on_spot(0.0))
    room.edge.refuses = True
    room.run(20.0)
    assert "refuses" in room.views[-1][1].problem
    assert sum(isinstance(r, TakeCharacter) for _, v in room.views for r in v.requests) >= 3
    room.edge.refuses = False
    room.run_until("possessed", 5.0)


def test_missing_character_is_left_out_and_reported():
    room = make_room(on_spot(0.0), characters=("chair", "lamp"))
    room.available = frozenset({"lamp"})
    room.run_until("possessed", 5.0)
    assert room.edge.holders == {"lamp": (1,)}
    assert "chair" in room.views[-1][1].problem


def test_empty_stage_waits_without_filling_the_ring():
    room = make_room(on_spot(0.0))
    room.available = frozenset()
    view = room.run(5.0)
    assert view.phase == Phase.NOTICED
    assert view.spot.ring == 0.0


def test_hold_by_a_panel_is_adopted():
    room = make_room(Person([(0.0, X + 1.0, Z + 1.0)]))
    room.run(2.0)
    room.edge.holders = {"chair": (1,)}
    assert room.run(0.3).phase == Phase.POSSESSED
    room.edge.holders = {"chair": ()}
    room.run_until("farewell", 2.0)


def test_hold_without_a_visitor_is_ended():
    room = make_room()
    room.edge.holders = {"chair": (77,)}
    room.run(3.0)
    assert room.edge.holders == {"chair": ()}


def test_hold_of_two_bodies_is_corrected():
    room = make_room(on_spot(0.0))
    room.run_until("possessed")
    room.run(2.0)
    room.edge.holders = {"chair": (1, 9)}
    room.run(2.0)
    assert room.edge.holders == {"chair": (1,)}


def test_suspended_computer_does_not_fill_the_ring():
    room = make_room(on_spot(0.0))
    room.run(0.3)
    room.now += 3600.0
    assert room.step().spot.ring < 0.6
