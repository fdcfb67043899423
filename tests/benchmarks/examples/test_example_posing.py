"""Tests that directions work, that stored sessions are small, and that missing data is reported."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
import pytest
from example_posing import Figure, Limb, bend, curl, lengthen, put, reach, shift, squash, turn, twist
from hypothesis import given
from hypothesis import strategies as st

HERE = Path(__file__).parent
REST = np.array([[0.2, 0, 0], [-0.2, 0, 0], [0, 2, 0], [0.5, 1.2, 0], [0.9, 1.2, 0], [-0.9, 1.2, 0]], float)
NAMES = ("left foot", "right foot", "head", "left elbow", "left hand", "right hand")
ARM = {
    "left arm": Limb(("left elbow", "left hand"), (0.1, 1.2, 0.0)),
    "forearm": Limb(("left hand",), "left elbow"),
}
FIGURE = Figure(NAMES, REST, ARM, ("left foot", "right foot"), 2.0)
ANGLES = st.floats(-170.0, 170.0)
SIDES = st.sampled_from(["up", "down", "left", "right", "front", "back", "out", "in"])


@given(ANGLES, SIDES)
def test_turn_keeps_limb_lengths_and_other_points(degrees, side):
    places = FIGURE.posed(turn("left arm", degrees, side))
    np.testing.assert_array_equal(np.delete(places, [3, 4], 0), np.delete(REST, [3, 4], 0))
    np.testing.assert_allclose(np.linalg.norm(places[3] - [0.1, 1.2, 0]), 0.4)
    np.testing.assert_allclose(np.linalg.norm(places[4] - places[3]), 0.4)


def test_sides_are_relative_to_the_figure():
    assert FIGURE.posed(turn("left arm", 90, "up"))[4] == pytest.approx([0.1, 2.0, 0])
    assert FIGURE.posed(turn("left arm", 90, "front"))[4] == pytest.approx([0.1, 1.2, 0.8])
    assert FIGURE.posed(turn("right hand", 90, "up"))[5] == pytest.approx([0, 2.1, 0])
    assert FIGURE.posed(reach("right hand", out=0.1))[5] == pytest.approx([-1.1, 1.2, 0])
    assert FIGURE.posed(reach("left arm", up=0.1))[3:5, 1] == pytest.approx([1.3, 1.4])
    assert FIGURE.posed(bend(90, "left"))[2] == pytest.approx([2, 0, 0], abs=1e-12)
    assert FIGURE.posed(twist(90))[4] == pytest.approx(
        [0.9 * np.cos(0.3 * np.pi), 1.2, -0.9 * np.sin(0.3 * np.pi)]
    )


def test_pivot_follows_its_control_point():
    places = FIGURE.posed(turn("left arm", 90, "up"), turn("forearm", 90, "out"))
    assert places[3] == pytest.approx([0.1, 1.6, 0])
    assert places[4] == pytest.approx([0.5, 1.6, 0])


@given(ANGLES)
def test_curl_keeps_distances_between_points(degrees):
    places = FIGURE.posed(curl("left arm", degrees, "up"))
    np.testing.assert_allclose(np.linalg.norm(places[4] - places[3]), 0.4)


@given(st.floats(0.3, 3.0), ANGLES, SIDES.filter(lambda side: side not in ("up", "down")))
def test_feet_stay_when_the_trunk_moves(factor, degrees, side):
    places = FIGURE.posed(squash(factor), bend(degrees, side), twist(degrees), shift(up=factor, left=0.2))
    np.testing.assert_array_equal(places[:2], REST[:2])


@given(st.floats(0.3, 3.0))
def test_squash_keeps_the_volume(factor):
    places = FIGURE.posed(squash(factor))[2:] / np.where(REST[2:] == 0, 1, REST[2:])
    wide = 1 / np.sqrt(factor)
    np.testing.assert_allclose(places[0, 1] * wide * wide, 1.0)
    np.testing.assert_allclose(places[1:, 0], wide)
    np.testing.assert_allclose(FIGURE.posed(lengthen("left arm", factor))[4, 0], 0.1 + 0.8 * factor)


def test_put_moves_the_end_and_the_limb():
    places = FIGURE.posed(put("left arm", up=0.9, front=0.2))
    assert places[4] == pytest.approx([0.9, 1.8, 0.4])
    np.testing.assert_allclose(places[3] - REST[3], places[4] - REST[4])


def test_stored_sessions_are_small_with_at_most_four_key_poses():
    paths = sorted((HERE / "example_sessions").glob("*.toml"))
    assert [path.stem for path in paths] == ["alligator", "armadillo", "cactus", "trex"]
    for path in paths:
        session = tomllib.loads(path.read_text(encoding="utf-8"))
        assert 2 <= len(session["pose"]) <= 4
        assert path.stat().st_size < 10_000
        assert session["mesh"]["file"].startswith("$ENLIVEN_DATA/")
        assert all(
            set(pose["places"]) == {point["name"] for point in session["point"]} for pose in session["pose"]
        )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("word", "said", "code"), [("cactus", "Set ENLIVEN_DATA", 1), ("dodo", "Known: cactus", 2)]
)
def test_missing_data_or_unknown_film_is_reported(tmp_path, word, said, code):
    place = {**os.environ, "ENLIVEN_DATA": str(tmp_path)}
    ran = subprocess.run(
        [sys.executable, HERE / "example_films.py", word], env=place, capture_output=True, text=True
    )
    assert ran.returncode == code
    assert said in ran.stderr
