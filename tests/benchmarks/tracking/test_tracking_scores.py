"""Tests of the scores on synthetic takes with known results."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven.person.limbs import Limb
from enliven.rotation import from_matrix, from_rotation_vector, multiply
from enliven_synthesis.body.performer import Performer
from enliven_synthesis.motion.exercises import get_exercise

sys.path.insert(0, str(Path(__file__).parent))
from tracking_cache import Moment
from tracking_scores import TURNS, Take, score

RATE = 30.0
PERFORMER = Performer()
SIDES = [0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7, 16, 17, 18, 19, 12, 13, 14, 15]


@cache
def joints_of(count: int, aside: float = 0.0, name: str = "overhead") -> np.ndarray:
    """Returns (F, 20, 3) a performer's true joints."""
    moves = get_exercise(name)
    return np.stack([PERFORMER.pose(moves.posture(n / RATE)).joints for n in range(count)]) + np.array(
        [aside, 0, 0]
    )


def take_of(truth: list[np.ndarray], found: list[np.ndarray | None], ids=None, confidence=0.95) -> Take:
    """Returns a take of people. ``found`` is (F, 20, 3) for each person, or None if the tracker has no
    body.
    """
    count = len(truth[0])
    moments = [
        Moment(
            np.ones(len(truth), bool), np.stack([t[f] for t in truth]), np.ones((len(truth), 20), bool),
            np.ones((len(truth), 2), bool),
        )
        for f in range(count)
    ]  # fmt: skip
    bodies = []
    for f in range(count):
        here = [(k, person[f]) for k, person in enumerate(found) if person is not None]
        bodies.append(
            [
                Body(ids[k][f] if ids else k + 1, joints, np.full(20, confidence))
                for k, joints in here
                if np.isfinite(joints).all()
            ]
        )
    return Take(np.arange(count) / RATE, moments, bodies, np.ones(count, bool), np.zeros(count))


def test_perfect_tracker_has_perfect_scores() -> None:
    truth = [joints_of(90), joints_of(90, 1.2)]
    s = score(take_of(truth, truth[::-1]))
    assert s.within == 1.0 and s.mean_mm == 0.0 and s.missed == 0
    assert (s.identity, s.mirrored, s.false) == (0, 0, 0)
    assert s.trusted(0.9) == 1.0


def test_first_half_second_does_not_count_as_missed() -> None:
    truth = [joints_of(60)]
    s = score(take_of(truth, truth))
    assert s.visible.sum() == (60 - 15) * 20
    assert np.isnan(s.per_frame[:15]).all() and (s.per_frame[15:] == 1.0).all()


@settings(max_examples=25, deadline=None)
@given(st.sets(st.integers(0, 19), max_size=8), st.floats(0.11, 0.3))
def test_each_wrong_joint_is_counted(wrong: set[int], by: float) -> None:
    truth = joints_of(40)
    joints = truth.copy()
    joints[:, sorted(wrong)] += [0.0, 0.0, by]
    s = score(take_of([truth], [joints]))
    assert s.within == pytest.approx(1 - len(wrong) / 20)
    assert all((s.hits[j] == 0) == (j in wrong) for j in range(20))
    assert s.mean_mm == pytest.approx(1e3 * by * len(wrong) / 20)


def test_hidden_joints_count_only_for_confidence() -> None:
    truth = joints_of(40)
    joints = truth.copy()
    joints[:, 7] += 1.0
    take = take_of([truth], [joints])
    for moment in take.moments:
        moment.visible[0, 7] = False
    s = score(take)
    assert s.within == 1.0 and s.visible[7] == 0
    assert s.trusted(0.9) == pytest.approx(0.95)


def test_untracked_person_is_missed() -> None:
    truth = [joints_of(60), joints_of(60, 1.5)]
    s = score(take_of(truth, [truth[0], None]))
    assert s.within == pytest.approx(0.5)
    assert s.missed == 45 * 20


def test_far_body_is_false_and_bad_fit_is_not() -> None:
    truth = joints_of(60)
    ghost = take_of([truth], [truth, truth - np.array([0, 0, 1.5])])
    assert score(ghost).false == 1
    assert score(take_of([truth], [truth, truth + np.array([0.1, 0, 0])])).false == 1  # two for one person
    folded = truth.copy()
    folded[:, 1:] = truth[:, :1] + 1.0
    assert score(take_of([truth], [folded])).false == 0


def test_exchanged_identities_count_as_swaps_and_flicker_does_not() -> None:
    truth = [joints_of(90), joints_of(90, 1.2)]
    ids = [np.array([1] * 45 + [2] * 45), np.array([2] * 45 + [1] * 45)]
    assert score(take_of(truth, truth, ids)).identity == 2
    ids = [np.array([1] * 45 + [9] + [1] * 44), np.full(90, 2)]
    assert score(take_of(truth, truth, ids)).identity == 0
    gone = truth[0].copy()
    gone[30:60] = np.nan
    back = [np.array([1] * 45 + [5] * 45), np.full(90, 2)]
    assert score(take_of(truth, [gone, truth[1]], back)).identity == 1  # they came back with another identity


def test_mirrored_limbs_count_once_per_pair_and_time() -> None:
    truth = joints_of(120)
    joints = truth.copy()
    joints[40:60] = joints[40:60][:, SIDES]
    joints[90:110] = joints[90:110][:, SIDES]
    s = score(take_of([truth], [joints]))
    assert 2 <= s.mirrored <= 4  # the arms twice, and the legs if they are far enough apart
    joints = truth.copy()
    joints[50] = joints[50][SIDES]
    assert score(take_of([truth], [joints])).mirrored == 0  # only one frame


@pytest.mark.parametrize("deviation", [0.002, 0.01])
def test_jitter_ignores_offset_and_drift(deviation: float) -> None:
    truth = joints_of(240, name="still")
    random = np.random.default_rng(2)
    drift = np.linspace(0, 0.05, 240)[:, None, None]
    joints = truth + 0.03 + drift + random.normal(0, deviation, truth.shape)
    s = score(take_of([truth], [joints]), still=True)
    assert np.mean(s.jitter) == pytest.approx(1e3 * deviation * np.sqrt(3), rel=0.1)


@pytest.mark.parametrize("after", [0, 4, 11])
def test_recovery_time_starts_when_the_lens_is_uncovered(after: int) -> None:
    truth = joints_of(90)
    joints = truth.copy()
    joints[30 : 60 + after] = np.nan
    take = take_of([truth], [joints])
    take.observed[30:60] = False
    s = score(take, covered=(1.0, 2.0))
    assert s.recovery == [pytest.approx(1e3 * after / RATE, abs=1)]
    assert s.visible.sum() == 15 * 20


def test_missing_recovery_is_infinite() -> None:
    truth = joints_of(90)
    lost = truth.copy()
    lost[30:] = np.nan
    assert score(take_of([truth], [lost]), covered=(1.0, 2.0)).recovery == [float("inf")]
    lost[30:] = truth[30:] + 0.2
    assert score(take_of([truth], [lost]), covered=(1.0, 2.0)).recovery == [float("inf")]


def test_confidence_is_compared_with_accuracy() -> None:
    truth = joints_of(60)
    joints = truth.copy()
    joints[:, :10] += 0.4
    s = score(take_of([truth], [joints], confidence=0.55))
    assert s.sure[5] == 60 * 20 and s.sure_hits[5] == 60 * 10
    assert np.isnan(s.trusted(0.9))


def test_scores_of_sequences_add_up() -> None:
    truth = joints_of(60)
    good, bad = score(take_of([truth], [truth])), score(take_of([truth], [None]))
    good.add(bad)
    assert good.within == pytest.approx(0.5) and good.missed == 45 * 20


@pytest.mark.parametrize("by", [0.0, 0.4, -1.2])
def test_turn_errors_are_measured_about_the_right_axis(by: float) -> None:
    """A turned head and a twisted hand give an error in degrees. A hand that points elsewhere does not."""
    figure = PERFORMER.pose(get_exercise("still").posture(1.0))
    turns = figure.frames[:, :, :3]
    orientations = np.tile([1.0, 0.0, 0.0, 0.0], (20, 1))
    for parts in TURNS.values():
        for joint, limb in parts:
            orientations[joint] = from_matrix(turns[limb])
    about_own_length = from_rotation_vector(turns[:, :, 1] * by)
    orientations[Joint.HEAD] = multiply(about_own_length[Limb.SKULL], orientations[Joint.HEAD])
    orientations[Joint.HAND_LEFT] = multiply(about_own_length[Limb.HAND_LEFT], orientations[Joint.HAND_LEFT])
    aside = from_rotation_vector(turns[Limb.HAND_RIGHT, :, 2] * by)
    orientations[Joint.HAND_RIGHT] = multiply(aside, orientations[Joint.HAND_RIGHT])
    truth = np.stack([figure.joints] * 30)
    take = take_of([truth], [truth])
    said_of = {"orientations": orientations, "contacts": np.array([1.0, 0.0])}
    take.bodies = [[replace(b, **said_of) for b in some] for some in take.bodies]
    take.moments = [replace(m, turns=turns[None]) for m in take.moments]
    s = score(take)
    degrees = np.degrees(abs(by))
    assert np.allclose(s.turned["head"], degrees, atol=0.02)
    assert np.allclose(s.turned["hand"][::2], degrees, atol=0.02)
    assert np.allclose(s.turned["hand"][1::2], 0.0, atol=0.02)
    assert np.allclose(s.turned["chest"], 0.0, atol=0.02)
    assert np.mean(s.standing) == 0.5  # both stand, but only one is reported as standing
