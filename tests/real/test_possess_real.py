"""Tests that real meshes driven by real joint recordings stay intact. Bounds are measured values plus a
margin.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "possession"))

import possess_films
from possess_measures import Measures, measure
from possess_take import perform

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not DATA.is_dir(), reason="the real recordings (ENLIVEN_DATA) are not here"),
]
STRETCH = {
    "chair-walk": 1.3,
    "real-chair": 1.3,
    "scan": 1.6,  # an arm that is raised high above where it hung, at the edge of an open surface
    "two-on-a-horse": 1.6,  # each walks round the other while both are attached
}
"""Maximum stretch of 95 % of the edges. Measured: 1.09, 1.17, 1.31, 1.21. The others are similar."""


@pytest.fixture(scope="module", params=STRETCH)
def filmed(request) -> tuple[str, Measures]:
    film = possess_films.list_real_films()[request.param]
    frames, actor = film.made()
    return request.param, measure(perform(frames[: 30 * 6], actor, film.acts), 12)


def test_surfaces_stretch_no_more_than_they_must(filmed) -> None:
    name, measures = filmed
    assert measures.stretch_95 < STRETCH[name]
    assert measures.squeeze_5 > 0.55


def test_hardly_a_triangle_turns_inside_out(filmed) -> None:
    assert filmed[1].inverted < 0.015


def test_legs_do_not_collapse(filmed) -> None:
    """Candy-wrapper twists and collapsed limbs lose volume. The scan is open and has no volume."""
    low, high = filmed[1].volume
    assert filmed[0] == "scan" or 0.7 < low <= high < 1.25


def test_shells_stay_together(filmed) -> None:
    assert filmed[1].gap < 0.03


def test_mesh_does_not_penetrate_the_floor(filmed) -> None:
    assert filmed[1].lowest > -0.03


def test_mesh_does_not_jump_at_attachment(filmed) -> None:
    assert filmed[1].hold_push < 4.0
