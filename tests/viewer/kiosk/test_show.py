"""Tests the whole show in simulated time, with a real edge and synthetic visitors that follow the screen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from kiosk_screening import Screening
from kiosk_visitors import RATE_HZ, StagedKiosk, SyntheticVisitor

from enliven.kiosk.profile import KioskCharacter, KioskProfile, StorySettings
from enliven.kiosk.story_table import Phase
from enliven_viewer.kiosk.show import KioskShow

WALKING_SPEED = 1.2
"""Speed of the visitor, metres per second."""


def shown_phase(frame) -> Phase:
    return frame.story.phase


@pytest.fixture(scope="module")
def stage():
    """Returns an edge with a chair. It is created once, because its preparation takes seconds."""
    kiosk = StagedKiosk(("chair", "chair"), name="kiosk-show")
    yield kiosk
    kiosk.close()


@pytest.fixture
def screening(stage):
    """Returns a show with that edge, without visitors."""
    stage.sensor.visitors.clear()
    stage.sensor.silent = False
    profile = KioskProfile(
        characters={"chair": KioskCharacter("chair", "chair")},
        story=StorySettings(session=30.0, language="en"),
    )
    screening = Screening(profile, stage)
    screening.run_until(lambda frame: frame.report.characters)
    yield screening
    screening.show.close()


def walk_to_circle(screening: Screening, visitor: SyntheticVisitor) -> None:
    """Moves the visitor one step towards the circle, like a person who sees it on the screen."""
    goal = np.array(screening.frame.story.spot.place)
    here = np.array(visitor.place)
    away = float(np.linalg.norm(goal - here))
    if away > 0.1:
        step = min(WALKING_SPEED / RATE_HZ, away)
        visitor.place = tuple((here + step * (goal - here) / away).tolist())


@pytest.mark.slow
def test_visitor_that_follows_the_screen_moves_a_character_within_six_seconds(screening):
    x, z = screening.profile.zone.center
    visitor = SyntheticVisitor(1, (x + 1.3, z - 0.8))
    screening.kiosk.sensor.visitors.append(visitor)
    entered, dances, shapes = screening.kiosk.now, False, []
    while screening.kiosk.now - entered < 6.0:
        screening.step()
        phase = shown_phase(screening.frame)
        if phase in (Phase.ATTRACT, Phase.NOTICED):
            walk_to_circle(screening, visitor)
        elif phase is Phase.POSSESSED and not dances:
            visitor.dance("chair", screening.kiosk.now)
            dances = True
        if dances:
            chair = next(a for a in screening.frame.scene.actors if a.character.id == "chair")
            shapes.append(chair.pose.positions)
    assert dances, screening.frame.story
    assert np.ptp(np.array(shapes), axis=0).max() > 0.15, "the character moves with the visitor"
    assert screening.kiosk.holders == {"chair": [1]}


@pytest.mark.slow
def test_seated_child_gets_a_character_too(screening):
    visitor = SyntheticVisitor(1, screening.profile.zone.center, height=1.1)
    screening.kiosk.sensor.visitors.append(visitor)
    screening.run_until(lambda frame: shown_phase(frame) is Phase.POSSESSED, 6.0)


@pytest.mark.slow
def test_character_turns_towards_a_new_visitor(screening):
    x, z = screening.profile.zone.center
    screening.run_until(lambda frame: shown_phase(frame) is Phase.ATTRACT)
    figure = screening.show._figures[0, "chair"]
    screening.kiosk.sensor.visitors.append(SyntheticVisitor(1, (x + 1.2, z - 0.5)))
    screening.run_until(lambda frame: shown_phase(frame) is Phase.NOTICED, 1.0)
    begin = screening.kiosk.now
    screening.run_until(lambda frame: figure.standing.yaw > 0.7, 1.0)
    assert screening.kiosk.now - begin <= 0.3


@pytest.mark.slow
def test_visit_ends_with_thanks_and_attract(screening):
    visitor = SyntheticVisitor(1, screening.profile.zone.center)
    screening.kiosk.sensor.visitors.append(visitor)
    screening.run_until(lambda frame: shown_phase(frame) is Phase.POSSESSED, 6.0)
    screening.kiosk.sensor.visitors.clear()
    screening.run_until(lambda frame: shown_phase(frame) is Phase.FAREWELL, 4.0)
    screening.run_until(lambda frame: shown_phase(frame) is Phase.ATTRACT, 6.0)
    assert screening.kiosk.holders == {"chair": []}


@pytest.mark.slow
def test_silent_camera_is_reported_to_operators_while_attract_continues(screening):
    screening.kiosk.sensor.silent = True
    screening.run_until(lambda frame: "camera" in frame.report.problem, 5.0)
    assert shown_phase(screening.frame) is Phase.ATTRACT
    assert_pictures_move(screening)


@pytest.mark.slow
def test_buttons_give_a_character_away_from_the_circle(screening):
    x, z = screening.profile.zone.center
    screening.kiosk.sensor.visitors.append(SyntheticVisitor(1, (x + 1.2, z)))
    screening.run_until(lambda frame: shown_phase(frame) is Phase.NOTICED, 2.0)
    screening.step("take")
    screening.run_until(lambda frame: shown_phase(frame) is Phase.POSSESSED, 2.0)
    screening.step("leave")
    assert shown_phase(screening.frame) is Phase.FAREWELL


@pytest.mark.slow
def test_attract_without_an_edge_shows_the_shipped_chair(profile):
    show = KioskShow(profile, Path())
    try:
        show._spare.result(120.0)
        frames = [show.advance(0.2) for _ in range(20)]
        assert all(frame.story.phase is Phase.ATTRACT for frame in frames)
        assert any(actor.character.id == "chair" for actor in frames[-1].scene.actors)
        assert "does not answer" in frames[-1].report.problem
    finally:
        show.close()


def assert_pictures_move(screening: Screening) -> None:
    """Fails if the camera and the characters do not move."""
    before = screening.show.get_camera_view(16 / 9).clip_from_world
    for _ in range(30):
        screening.step()
    assert np.abs(screening.show.get_camera_view(16 / 9).clip_from_world - before).max() > 1e-3
