"""Tests that the example films' sessions are stored as directed, and play within the films' quality
bounds.
"""

import importlib
import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from enliven.examples.puppet_examples import examples_from_key_poses
from enliven.examples.puppet_motion import solve_layer_motion
from enliven.modeling.mesh.mirror_plane import plane_of_symmetry

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "examples"))
acts = importlib.import_module("example_acts")
cast = importlib.import_module("example_cast")
measures = importlib.import_module("example_measures")
playing = importlib.import_module("example_play")

OWN = [name for name, act in acts.ACTS.items() if not act.of]
MISSING = [path for act in acts.ACTS.values() for path in act.missing]
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(bool(MISSING), reason=f"{MISSING[:1]} is not there (set ENLIVEN_DATA)"),
]
SMOOTHED = {"cactus": 0.005, "trex": 0.02, "armadillo": 0.02, "alligator": 0.1}
"""Maximum deviation from key poses as a fraction of the mesh size. A hop lasts a tenth of a second, so
smoothing affects it.
"""
HANDS = {"cactus": 0.9, "armadillo": 0.6}
"""Minimum correlation between the heights of hands and of their control points."""


@lru_cache
def project_of(name):
    return cast.stored(name).project


def short(name, seconds=1.5, rate=12.0):
    """Returns the frames of a short part of a film."""
    act = acts.ACTS[name]
    shown = act.shown[0]
    piece = replace(shown, last=min(shown.last, shown.first + seconds))
    play = playing.Play(act, project_of(name), piece, rate)
    return play, list(play.shots())


@pytest.mark.parametrize("name", OWN)
def test_the_stored_session_is_what_was_directed(name):
    act = acts.ACTS[name]
    directed = cast.staged(act)
    text = (cast.SESSIONS / f"{name}.toml").read_text(encoding="utf-8")
    assert text == cast.session_of(act, directed), "make it anew: example_films.py --sessions"
    puppet, stored = (next(iter(p.puppets.values())) for p in (directed, project_of(name)))
    assert puppet.points == stored.points
    assert len(stored.poses) <= 4
    np.testing.assert_array_equal([p.places for p in puppet.poses], [p.places for p in stored.poses])


@pytest.mark.parametrize("name", OWN)
def test_key_poses_are_met(name):
    project = project_of(name)
    puppet = next(iter(project.puppets.values()))
    size = np.linalg.norm(np.ptp(puppet.mesh.vertices, axis=0))
    assert measures.missed(puppet, solve_layer_motion(project, puppet, 0)) < SMOOTHED[name] * size
    how = {"examples": replace(puppet.examples, acceleration=0.0)}
    # Standing feet slide if drift correction pulls a puppet back, so its leash is long here.
    plain = replace(puppet, locomotion=replace(puppet.locomotion, plant=0.0, leash=1000.0), **how)
    plain = plain.with_changes(layers=(replace(puppet.layers[0], level_feet=False),))
    assert measures.missed(plain, solve_layer_motion(project, plain, 0)) < 1e-9


@pytest.mark.parametrize("name", OWN)
def test_the_anchor_does_not_slide(name):
    project = project_of(name)
    puppet = next(iter(project.puppets.values()))
    motion = solve_layer_motion(project, puppet, 0)
    assert measures.slide(motion) < 1.5e-3  # metres; lower if no foot is planted
    assert motion.travels
    # Its supporting points stay above the floor, and it never jumps far.
    feet = [k for k, point in enumerate(puppet.points) if point.foot]
    under = motion.places[:, feet, 1] + motion.root[:, 1, None] - puppet.rest[feet, 1].min()
    assert under.min() > -1e-9
    assert under.min(1).max() < acts.ACTS[name].height


@pytest.mark.parametrize("name", list(HANDS))
def test_hands_are_high_when_the_performers_are(name):
    project = project_of(name)
    puppet = next(iter(project.puppets.values()))
    assert measures.hands(project, puppet, solve_layer_motion(project, puppet, 0)) > HANDS[name]


@pytest.mark.parametrize("name", OWN)
def test_the_surface_follows_and_stays_whole(name):
    play, shots = short(name)
    held = [point.vertex for point in play.puppet.points]
    for shot in shots:
        assert np.isfinite(shot.local).all()
        np.testing.assert_allclose(shot.vertices[held], shot.pose.positions[1:], atol=1e-4)
    crossing = measures.crossings(play.puppet.mesh, [shot.local for shot in shots[::6]])
    assert crossing[1] < 0.01
    low, high = measures.volumes(play.puppet.mesh, [shot.local for shot in shots])
    assert np.isnan(low) or (low > 0.85 and high < 1.25)


def test_a_walk_is_shown_mirrored_left_to_right():
    project = project_of("trex")
    examples = examples_from_key_poses(project, next(iter(project.puppets.values())))
    assert len(examples) == 4
    plane = plane_of_symmetry(next(iter(project.puppets.values())).mesh)
    assert plane is not None
    assert abs(np.dot(plane.normal, cast.MIDDLE.normal)) > 0.999
    assert abs(plane.point[0]) < 0.01
    left, right = examples.find_point("left toes"), examples.find_point("right toes")
    np.testing.assert_allclose(examples.sources[0, left, 1:], examples.sources[2, right, 1:], atol=1e-3)
    np.testing.assert_allclose(examples.sources[0, left, 0], -examples.sources[2, right, 0], atol=1e-3)


def test_the_trex_goes_ahead():
    project = project_of("trex")
    motion = solve_layer_motion(project, next(iter(project.puppets.values())), 0)
    ahead = np.diff(motion.root[12:, 2])
    assert ahead.sum() > 3.0
    assert -ahead[ahead < 0].sum() < 0.05


def test_a_picture_shows_performer_puppet_and_key_poses():
    moderngl = pytest.importorskip("moderngl")
    studio = importlib.import_module("example_studio")
    try:
        small = studio.Studio((192, 108))
    except moderngl.Error as error:
        pytest.skip(f"no OpenGL here: {error}")
    play, shots = short("cactus", 0.2, 10.0)
    strip = small.strip(play)
    assert strip.shape == (108, 24, 3)
    assert (
        (strip.reshape(4, 27, 24, 3).astype(int)[..., 1] - strip.reshape(4, 27, 24, 3)[..., 2] > 30)
        .any((1, 2))
        .all()
    )
    picture = small.picture(play, 0, shots[0], None).astype(int)
    assert picture.shape == (108, 192, 3)
    left, right = picture[:, :56], picture[:, 58:168]
    # Teal is on the left, green on the right.
    assert (left[..., 2] - left[..., 0] > 40).sum() > 20
    assert (right[..., 1] - right[..., 2] > 30).sum() > 200
