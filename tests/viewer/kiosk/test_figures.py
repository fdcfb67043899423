"""Tests of the kiosk's figures: they stand on the floor, turn at once, and never jump."""

from __future__ import annotations

import math

import numpy as np
import pytest

from enliven_viewer.kiosk.carousel import Carousel
from enliven_viewer.kiosk.figures import CharacterFigure, WaitingPlace, stand_character
from enliven_viewer.kiosk.floor_marks import FloorMark, SpotMark

PLACE = (0.4, -2.5)


def vertices_of(actor):
    """Returns (V, 3) the surface of a figure."""
    if actor.vertices is not None:
        return actor.vertices
    character, matrices = actor.character, actor.pose.matrices(actor.character.pivots)
    moved = np.einsum("jab,vb->vja", matrices[:, :, :3], character.vertices) + matrices[:, :, 3]
    chosen = np.take_along_axis(moved, character.skin.indices[:, :, None].astype(int), 1)
    return (chosen * character.skin.weights[:, :, None]).sum(1)


def test_waiting_character_stands_on_its_place_in_the_visitors_height(box):
    shown = vertices_of(stand_character(box, WaitingPlace(PLACE, 0.7, 1.5)))
    assert shown[:, 1].min() == pytest.approx(0.0, abs=1e-5)
    assert np.ptp(shown[:, 1]) == pytest.approx(1.5, rel=1e-5)
    assert (shown.max(0) + shown.min(0))[[0, 2]] / 2 == pytest.approx(PLACE, abs=1e-5)


@pytest.mark.parametrize("yaw", [1.4, -1.4, math.pi])
def test_character_has_turned_to_a_visitor_after_300_milliseconds(yaw):
    figure = CharacterFigure(PLACE)
    for _ in range(9):
        figure.turn_to(PLACE, yaw, 1.7, 1 / 30)
    assert abs(math.remainder(figure.standing.yaw - yaw, 2 * math.pi)) < 0.12 * abs(yaw)


def test_figure_passes_over_without_a_jump(box):
    figure = CharacterFigure(PLACE)
    far = stand_character(box, WaitingPlace((2.0, -3.0), 1.0, 1.7))
    before = vertices_of(figure.show(box, None, "waits", 1 / 30))
    farthest = 0.0
    for _ in range(40):
        now = vertices_of(figure.show(box, far, "edge", 1 / 30))
        farthest = max(farthest, float(np.linalg.norm(now - before, axis=1).max()))
        before = now
    assert farthest < 0.3
    assert before == pytest.approx(vertices_of(far), abs=1e-5)


def test_figure_waits_until_the_driven_character_has_reached_its_performer(box):
    figure = CharacterFigure(PLACE)
    standing = vertices_of(figure.show(box, None, "waits", 1 / 30))
    far = stand_character(box, WaitingPlace((2.0, -3.0), 0.0, 1.7))
    near = stand_character(box, WaitingPlace(PLACE, 0.2, 1.7))
    for _ in range(10):
        shown = figure.show(box, far, "edge", 1 / 30, PLACE)
    assert vertices_of(shown) == pytest.approx(standing, abs=1e-5)
    for _ in range(30):
        shown = figure.show(box, near, "edge", 1 / 30, PLACE)
    assert vertices_of(shown) == pytest.approx(vertices_of(near), abs=1e-5)


def test_character_that_never_comes_near_is_shown_after_a_second(box):
    figure = CharacterFigure(PLACE)
    figure.show(box, None, "waits", 1 / 30)
    far = stand_character(box, WaitingPlace((2.0, -3.0), 0.0, 1.7))
    for _ in range(60):
        shown = figure.show(box, far, "edge", 1 / 30, PLACE)
    assert vertices_of(shown) == pytest.approx(vertices_of(far), abs=1e-5)


def test_ring_is_as_long_as_its_filling():
    mark = FloorMark("ring", (255, 255, 255))
    for fraction in (0.25, 0.5, 1.0):
        points = mark.make_mark(PLACE, 0.3, 0.4, fraction).vertices
        outer = points[1::2]
        length = float(np.linalg.norm(np.diff(outer, axis=0), axis=1).sum())
        assert length == pytest.approx(2 * math.pi * 0.4 * fraction, rel=0.01)
        assert np.linalg.norm(outer[:, [0, 2]] - PLACE, axis=1) == pytest.approx(0.4, rel=1e-4)


def test_spot_without_filling_has_no_ring():
    spot = SpotMark(0, (255, 196, 92), (255, 255, 255))
    assert len(spot.draw(PLACE, 0.5, 0.0, 0.0)) == 1
    assert len(spot.draw(PLACE, 0.5, 0.3, 0.0)) == 3


def test_carousel_shows_both_neighbours_while_it_is_open(box):
    carousel, names = Carousel(), ["a", "b", "c"]
    characters = dict.fromkeys(names, box)
    for _ in range(60):
        shown = carousel.draw(names, characters, "a", PLACE, open=True, seconds=1 / 30)
    across = sorted(float(actor.pose.positions[:, 0].mean()) - PLACE[0] for actor in shown)
    assert [np.ptp(vertices_of(actor)[:, 1]) > 0.3 for actor in shown] == [True, True]
    assert across[0] < -0.5 < 0.5 < across[1]
    for _ in range(60):
        shown = carousel.draw(names, characters, "a", PLACE, open=False, seconds=1 / 30)
    assert max(np.ptp(vertices_of(actor)[:, 1]) for actor in shown) < 0.001
