"""Tests of fusing the bodies of several sensors, also if a sensor is wrong."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from walkers import Walker

from enliven.person.body import Body
from enliven.rotation import from_rotation_vector, multiply, rotate
from enliven_edge.fusion.live import blending
from enliven_edge.fusion.live.fuser import Fuser, make_standing_person, warm_up_fusion
from enliven_edge.fusion.live.grouping import is_plausible
from enliven_edge.fusion.live.sensor_view import SensorState
from enliven_edge.fusion.live.side_assignment import swap_sides
from enliven_edge.fusion.settings import FusionSettings
from enliven_synthesis.motion.wander import WalkPath

EYES = {"a": np.array([0.0, 1.2, 0.0]), "b": np.array([2.5, 1.2, -2.0]), "c": np.array([-2.5, 1.2, -2.0])}
STEP = 1 / 30
STANDING = Walker(WalkPath(8.0, 0.0, 0.0)).joints(0.0)
OTHERS = np.array([0.0, 0.0, -1.2])


def shifted(x: float, y: float = 0.0, z: float = 0.0):
    """Returns the standing person, moved to another position."""
    return STANDING + np.array([x, y, z])


def ns(time: float) -> int:
    return round(time * 1e9)


def body(joints, number=1, sure=1.0, **more) -> Body:
    return Body(number, np.array(joints, float), np.full(20, sure), **more)


def run(says, seconds, sensors=("a", "b"), fuser=None, start=0.0, alive=True):
    """Feeds a fuser with the bodies (or None) from ``says(sensor, time)``, and yields (time, bodies)."""
    fuser = fuser or Fuser({name: EYES[name] for name in sensors})
    for n in range(round(seconds / STEP)):
        time = start + n * STEP
        for name in sensors:
            reported = says(name, time)
            if reported is not None:
                # A real person never stands so still that two frames are bit-identical.
                bodies = [dataclasses.replace(b, joints=b.joints + 1e-9 * n * alive) for b in reported]
                fuser.update(name, bodies, ns(time))
        yield time, fuser.bodies(ns(time)), fuser


def last(outcome):
    """Returns the last fused bodies, and the fuser."""
    *_, (_, bodies, fuser) = outcome
    return bodies, fuser


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 3), st.integers(0, 1000))
def test_identical_bodies_are_fused_to_themselves(count, seed):
    random = np.random.default_rng(seed)
    walker, phase = Walker(), random.uniform(0, 10)
    turns = from_rotation_vector(random.normal(size=(20, 3)))
    for time, bodies, _ in run(
        lambda name, t: [body(walker.joints(t + phase), orientations=turns)], 0.6, "abc"[:count]
    ):
        if time > 0.2:
            (fused,) = bodies
            assert np.allclose(fused.joints, walker.joints(time + phase), atol=1e-7)
            assert np.allclose(
                fused.orientations, turns * np.sign((fused.orientations * turns).sum(1))[:, None]
            )
            assert np.allclose(fused.confidence, 1.0)
            assert fused.id == 1


@settings(max_examples=10, deadline=None)
@given(st.permutations(["a", "b", "c"]), st.permutations([3, 17, 5]), st.integers(0, 100))
def test_order_of_sensors_and_their_ids_do_not_matter(order, numbers, seed):
    random = np.random.default_rng(seed)
    shifts = {name: 0.03 * random.normal(size=(20, 3)) for name in "abc"}

    def told(name, time, ids=(1, 2)):
        return [body(STANDING + shifts[name], ids[0]), body(STANDING + OTHERS + shifts[name], ids[1])]

    plain, _ = last(run(told, 0.5, "abc"))
    other, _ = last(run(lambda n, t: told(n, t, (numbers[1], numbers[2]))[::-1], 0.5, order))
    assert len(plain) == len(other) == 2
    for person in plain:
        assert min(np.abs(person.joints - partner.joints).max() for partner in other) < 1e-9


def test_bodies_of_different_times_are_aligned():
    """Two sensors expose at different times while a person passes at 2 m/s."""
    fuser = Fuser({n: EYES[n] for n in "ab"})
    worst = 0.0
    for n in range(60):
        for name, later in (("a", 0.0), ("b", 0.015)):
            time = n * STEP + later
            fuser.update(name, [body(shifted(2.0 * time - 2.0, 0, 0))], ns(time))
            fused = fuser.bodies(ns(time))
            if n > 20:
                worst = max(worst, np.abs(fused[0].joints - STANDING - [2.0 * time - 2.0, 0, 0]).max())
    assert worst < 1e-3


def test_the_nearer_and_surer_sensor_counts_more():
    near, far = shifted(0.03, 0, 0), STANDING
    eyes = {"a": STANDING[0] + [0, 0, 1.5], "b": STANDING[0] + [0, 0, 4.5]}
    fuser = Fuser(eyes)
    fused, _ = last(run(lambda n, t: [body(near if n == "a" else far)], 2.0, fuser=fuser))
    assert 0.02 < (fused[0].joints - far)[:, 0].mean() < 0.03
    sure = {"a": 0.9, "b": 0.1}
    fused, _ = last(run(lambda n, t: [body(near if n == "a" else far, sure=sure[n])], 2.0))
    assert (fused[0].joints - far)[:, 0].mean() > 0.02
    assert fused[0].confidence == pytest.approx(0.9, abs=0.06)


def test_contradiction_lowers_confidence():
    together, _ = last(run(lambda n, t: [body(STANDING)], 1.0))
    apart, _ = last(run(lambda n, t: [body(shifted(0.15 * (n == "b"), 0, 0))], 1.0))
    assert together[0].confidence.min() > 0.99 > 0.8 > apart[0].confidence.max()


def test_handing_over_makes_no_jump_and_ends_where_the_other_sees():
    """Two sensors differ by 6 cm. One of them loses the person from 1 s to 2.5 s."""

    def told(name, time):
        if name == "b":
            return [body(shifted(0.06, 0, 0), 4)]
        return [] if 1.0 <= time < 2.5 else [body(STANDING)]

    xs = {time: bodies[0].joints[3, 0] for time, bodies, _ in run(told, 4.0) if bodies}
    path = np.array(list(xs.values())) - STANDING[3, 0]
    assert np.abs(np.diff(path)).max() < 0.006
    assert path[28] == pytest.approx(0.03, abs=0.015)
    assert path[70] == pytest.approx(0.06, abs=0.002)
    assert path[-1] == pytest.approx(0.03, abs=0.015)


def test_one_joint_lost_makes_no_jump():
    def told(name, time):
        sighting = body(shifted(0.05 * (name == "b")))
        if name == "a" and 1.0 <= time < 2.0:
            sighting.confidence[7] = 0.0
        return [sighting]

    hands = np.array([bodies[0].joints[7] for _, bodies, _ in run(told, 3.0) if bodies])
    assert np.linalg.norm(np.diff(hands, axis=0), axis=1).max() < 0.006


def test_a_hand_that_one_sensor_throws_away_stays():
    """One sensor reports a hand 60 cm off with full confidence. The previous position is evidence against
    it.
    """

    def told(name, time):
        joints = STANDING.copy()
        if name == "a" and time > 1.0:
            joints[6:8] += [0.6, 0.1, 0.0]
        return [body(joints)]

    off = [np.linalg.norm(b[0].joints[7] - STANDING[7]) for _, b, _ in run(told, 4.0) if b]
    assert max(off) < 0.1


@pytest.mark.parametrize("sensors", ["ab", "abc"])
def test_one_sensor_exchanges_the_sides_for_a_while(sensors):
    walker = Walker()

    def told(name, time):
        seen = body(walker.joints(time))
        return [swap_sides(seen) if name == "b" and 1.0 <= time < 4.0 else seen]

    for time, bodies, _ in run(told, 6.0, sensors):
        if bodies:
            assert np.abs(bodies[0].joints - walker.joints(time)).max() < 0.02


def test_left_right_swap_is_corrected_by_majority():
    walker = Walker()
    for time, bodies, _ in run(
        lambda n, t: [swap_sides(body(walker.joints(t))) if n == "a" else body(walker.joints(t))], 4.0, "abc"
    ):
        if time > 0.3:
            assert np.abs(bodies[0].joints - walker.joints(time)).max() < 1e-6


def test_walking_direction_decides_between_swapped_sides():
    """Sensor a swaps left and right from the start. The person walks forward, so b is used."""
    walker = Walker()
    fused, _ = last(
        run(lambda n, t: [swap_sides(body(walker.joints(t))) if n == "a" else body(walker.joints(t))], 6.0)
    )
    assert np.abs(fused[0].joints - walker.joints(6.0 - STEP)).max() < 0.02


def test_lasting_agreement_of_all_sensors_swaps_the_sides():
    walker = Walker()
    wrong = [
        np.abs(b[0].joints - walker.joints(t)).max() > 0.05
        for t, b, _ in run(
            lambda n, t: [swap_sides(body(walker.joints(t))) if t < 0.5 else body(walker.joints(t))], 5.0
        )
        if b
    ]
    assert not any(wrong[-60:])


def test_identities_hold_through_a_crossing_in_which_one_sensor_swaps_them():
    """Two people pass each other 40 cm apart. At that moment, sensor a permanently swaps their ids."""
    swapped_at = 2.0

    def where(time):
        x = 1.5 * (time - swapped_at) / swapped_at
        return shifted(x, 0, 0.2), shifted(-x, 0, -0.2)

    def told(name, time):
        first, second = where(time)
        crossed = name == "a" and time >= swapped_at
        return [body(first, 2 if crossed else 1), body(second, 1 if crossed else 2)]

    ids = set()
    first = None
    for time, bodies, _ in run(told, 4.0):
        ids |= {b.id for b in bodies}
        for b in bodies:
            near = int(
                np.linalg.norm(b.joints[0] - where(time)[1][0])
                < np.linalg.norm(b.joints[0] - where(time)[0][0])
            )
            if first is None and len(bodies) == 2:
                first = {x.id: int(np.linalg.norm(x.joints[0] - where(time)[1][0]) < 0.1) for x in bodies}
            if first is not None and abs(time - swapped_at) > 0.4:
                assert first[b.id] == near, time
    assert ids == {1, 2}


def test_somebody_hidden_from_one_sensor_then_from_the_other_stays_the_same():
    def told(name, time):
        hidden = name == ("a" if 1.0 <= time < 2.0 else "b" if 2.0 <= time < 3.0 else "")
        return [body(STANDING, 1)] + ([] if hidden else [body(STANDING + OTHERS, 2 if time < 2 else 7)])

    counts = [sorted(b.id for b in bodies) for time, bodies, _ in run(told, 4.0) if time > 0.3]
    assert counts == [[1, 2]] * len(counts)


def test_person_back_soon_keeps_identity():
    """A person is not visible for 2 s, and keeps the identity at the new position."""

    def told(name, time):
        return [] if 1.0 <= time < 3.0 else [body(shifted(0.3 * (time > 2), 0, 0), 1 if time < 2 else 9)]

    assert {b.id for _, bodies, _ in run(told, 4.0) for b in bodies} == {1}


def test_person_back_late_gets_the_sensors_identity():
    """A person who returns elsewhere after 10 s keeps the identity only if the tracker's id is unchanged."""
    for number, expected in ((1, {1}), (5, {1, 2})):

        def told(name, time, number=number):
            if time < 1.0:
                return [body(STANDING, 1)]
            return [] if time < 11.0 else [body(shifted(1.5, 0, 0), number)]

        assert {b.id for _, bodies, _ in run(told, 12.0) for b in bodies} == expected


def test_implausible_joints_are_not_a_person():
    heap = STANDING.copy()
    heap[3] += [0, -0.7, 1.1]

    def told(name, time):
        return [body(STANDING + OTHERS, 1)] + ([body(heap, 2)] if name == "a" and time > 0.5 else [])

    assert {b.id for _, bodies, _ in run(told, 2.0) for b in bodies} == {1}


def test_half_a_body_next_to_a_whole_one_is_not_a_person():
    """Sensor a detects the legs as a second person. Sensor b, which covers the same area, sees one person."""
    half = STANDING * [1.0, 0.6, 1.0] + [0.1, 0.0, 0.1]

    def told(name, time):
        return [body(STANDING, 1), *([body(half, 2)] if name == "a" else [])]

    assert {b.id for _, bodies, _ in run(told, 3.0) for b in bodies} == {1}


def test_two_who_stand_close_and_hide_each_other_stay_two():
    """Two known people stand 30 cm apart. For two seconds, sensor b sees only one of them."""
    close = shifted(0.3)

    def told(name, time):
        apart = shifted(1.2 - min(time, 1.0) * 0.9)
        hidden = name == "b" and 1.5 < time < 3.5
        return [body(STANDING, 1), *([] if hidden else [body(apart if time < 1 else close, 2)])]

    counts = [sorted(b.id for b in bodies) for time, bodies, _ in run(told, 5.0) if time > 0.3]
    assert counts == [[1, 2]] * len(counts)


def test_silent_sensor_is_reported_and_bodies_continue():
    def told(name, time):
        return None if name == "a" and time >= 1.0 else [body(STANDING, 3)]

    seen = [len(bodies) for time, bodies, _ in run(told, 3.5) if time > 0.3]
    assert seen == [1] * len(seen)
    _, fuser = last(run(told, 3.5))
    (warning,) = fuser.take_warnings()
    assert (warning.sensor, warning.state) == ("a", SensorState.SILENT)
    assert 1.95 < warning.time_ns * 1e-9 < 2.1
    assert fuser.take_warnings() == []


def test_a_sensor_that_freezes_is_given_up_and_taken_back():
    walker = Walker()

    def told(name, time):
        return [body(walker.joints(min(time, 1.0) if name == "a" and time < 5.0 else time))]

    fuser = Fuser({n: EYES[n] for n in "ab"})
    for time, bodies, _ in run(told, 7.0, alive=False, fuser=fuser):
        if time > 3.0:
            assert np.abs(bodies[0].joints - walker.joints(time)).max() < 0.02
    warnings = [(w.sensor, w.state) for w in fuser.take_warnings()]
    assert warnings == [("a", SensorState.FROZEN), ("a", SensorState.LIVE)]


def test_a_sensor_that_comes_late_is_welcome():
    walker = Walker()
    fuser = Fuser({n: EYES[n] for n in "ab"})
    for time, bodies, _ in run(
        lambda n, t: None if n == "b" and t < 2.0 else [body(walker.joints(t))], 4.0, fuser=fuser
    ):
        if time > 0.3:
            assert [b.id for b in bodies] == [1]
            assert np.abs(bodies[0].joints - walker.joints(time)).max() < 1e-6
    assert fuser.take_warnings() == []


def test_frames_out_of_order_are_left_out():
    fuser = Fuser({n: EYES[n] for n in "ab"})
    assert fuser.update("a", [body(STANDING)], ns(1.0))
    assert not fuser.update("a", [body(STANDING + 5.0)], ns(0.9))
    assert not fuser.update("a", [body(STANDING + 5.0)], ns(1.0))
    assert fuser.views[0].sightings[1].body.joints is not None
    assert np.allclose(fuser.views[0].sightings[1].body.joints, STANDING)


def test_moved_sensor_is_reported():
    """The moved one of three sensors is identified, and people stay at the positions seen by the other
    two.
    """

    def told(name, time):
        return [body(shifted(0.35 * (name == "c" and time > 1.0), 0, 0))]

    bodies, fuser = last(run(told, 12.0, "abc"))
    assert [(w.sensor, w.state) for w in fuser.take_warnings()] == [("c", SensorState.MOVED)]
    assert np.abs(bodies[0].joints - STANDING).max() < 0.02


def test_ended_sensor_is_reported_as_lost():
    fuser = Fuser({n: EYES[n] for n in "ab"})
    last(run(lambda n, t: [body(STANDING)], 1.0, fuser=fuser))
    fuser.end("a", SensorState.LOST, ns(1.0))
    bodies, _ = last(run(lambda n, t: [body(STANDING)] if n == "b" else None, 1.0, fuser=fuser, start=1.0))
    assert len(bodies) == 1
    assert [w.state for w in fuser.take_warnings()] == [SensorState.LOST]


def test_turns_are_meant_with_either_sign():
    turn = from_rotation_vector(np.array([0.0, 0.3, 0.0]))
    base = from_rotation_vector(np.random.default_rng(0).normal(size=(20, 3)))

    def told(name, time):
        turned = multiply(turn, base) if name == "a" else -multiply(np.array([1, -1, -1, -1]) * turn, base)
        return [body(STANDING, orientations=turned)]

    eyes = {n: STANDING[0] + [0, 0, 2.0] for n in "ab"}
    (fused,), _ = last(run(told, 3.0, fuser=Fuser(eyes)))
    assert np.abs(np.abs((fused.orientations * base).sum(1)) - 1.0).max() < 1e-5
    assert np.allclose(np.linalg.norm(fused.orientations, axis=1), 1.0)


def test_an_orientation_that_one_sensor_has_is_kept():
    turns = from_rotation_vector(np.random.default_rng(0).normal(size=(20, 3)))

    def told(name, time):
        return [
            body(STANDING, orientations=turns if name == "a" else None, stature=1.8 if name == "b" else None)
        ]

    (fused,), _ = last(run(told, 1.0))
    assert np.abs(np.abs((fused.orientations * turns).sum(1)) - 1.0).max() < 1e-9
    assert fused.stature == pytest.approx(1.8)


def test_swapping_sides_twice_is_identity_and_once_turns_the_front():
    turns = from_rotation_vector(np.random.default_rng(2).normal(size=(20, 3)))
    whole = body(STANDING, orientations=turns, contacts=np.array([0.2, 0.9]))
    once, twice = swap_sides(whole), swap_sides(swap_sides(whole))
    assert np.allclose(twice.joints, whole.joints) and np.allclose(twice.contacts, whole.contacts)
    assert np.allclose(np.abs((twice.orientations * turns).sum(1)), 1.0)
    ahead = np.array([0.0, 0.0, 1.0])
    assert np.allclose(rotate(once.orientations[0], ahead), -rotate(turns[0], ahead))


def test_many_people_before_two_sensors_keep_apart():
    """Six people on a grid keep six identities for ten seconds, with noise and different id orders."""
    random = np.random.default_rng(0)
    spots = [np.array([x, 0.0, z]) for x in (-1.0, 0.0, 1.0) for z in (0.0, -0.9)]

    def told(name, time):
        order = range(6) if name == "a" else reversed(range(6))
        return [body(STANDING + spots[i] + 0.02 * random.normal(size=(20, 3)), 10 + i) for i in order]

    for time, bodies, _ in run(told, 10.0):
        if time > 0.3:
            assert [b.id for b in bodies] == [1, 2, 3, 4, 5, 6]


def test_warm_up_leaves_no_kernel_to_compile():
    assert is_plausible(body(make_standing_person()))
    warm_up_fusion()
    kernels = (blending.blend, blending.doubt_outliers, blending.fuse_confidence, blending.side_costs)
    before = [len(kernel.signatures) for kernel in kernels]
    turns = from_rotation_vector(np.zeros((20, 3)))
    last(run(lambda n, t: [body(STANDING, orientations=turns), body(STANDING + OTHERS, 2)], 0.5))
    assert [len(kernel.signatures) for kernel in kernels] == before


def test_sure_after_setting_delays_new_bodies():
    quick = FusionSettings(sure_after=1)
    fuser = Fuser({"a": EYES["a"]}, quick)
    fuser.update("a", [body(STANDING)], 0)
    assert len(fuser.bodies(0)) == 1
    slow = dataclasses.replace(quick, sure_after=10)
    fuser = Fuser({"a": EYES["a"]}, slow)
    fuser.update("a", [body(STANDING)], 0)
    assert fuser.bodies(0) == []
