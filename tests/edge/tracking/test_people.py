"""Tests of several people: stable identities through crossing, touching, hiding, leaving and returning."""

import dataclasses

import numpy as np
import pytest

from enliven_edge.tracking.settings import PeopleSettings, SceneSettings, TrackerSettings
from enliven_edge.tracking.tracker import Tracker

APPEARS = 6
"""Number of frames within which people in the first frame are detected (a fifth of a second)."""
JOINED = 11
"""Number of frames within which two touching people are detected. They are first searched as one person."""


def ids_of(log, player):
    """Returns all ids that a player ever had."""
    return {who[player] for _, _, who in log} - {None}


def seen(log, player):
    """Returns the fraction of frames with a tracked body on a player."""
    return float(np.mean([who[player] is not None for _, _, who in log]))


def most(log):
    return max(len(bodies) for _, bodies, _ in log)


def through(*keys):
    """Returns (x, z, yaw) over time through (time, x, z) keys."""
    times, x, z = np.array(keys, float).T
    return lambda time: (float(np.interp(time, times, x)), float(np.interp(time, times, z)), 0.0)


def test_crossing_people_keep_their_identities(stagecraft):
    s = stagecraft
    front = s.Player(s.line((-0.9, -2.2), (0.9, -2.2), 0.2, 2.2), "walk", s.Proportions(height=1.7))
    behind = s.Player(s.line((1.0, -3.0), (-1.0, -3.0), 0.2, 2.2), "walk", s.Proportions(height=1.82))
    log = s.watch(s.Playground(front, behind), Tracker(), 2.8)
    assert len(ids_of(log, 0)) == len(ids_of(log, 1)) == 1
    assert ids_of(log, 0) != ids_of(log, 1)
    assert seen(log[APPEARS:], 0) == 1.0
    assert seen(log[-12:], 1) == 1.0
    assert most(log) == 2


@pytest.mark.slow
def test_occluded_person_turning_back_keeps_identity(stagecraft):
    """Both have the same height, so only their positions distinguish them."""
    s = stagecraft
    front = s.Player(
        through((0.2, -0.9, -2.3), (1.2, 0.1, -2.3), (1.5, 0.1, -2.3), (2.5, -0.9, -2.3)), "walk"
    )
    behind = s.Player(through((0.2, 0.9, -2.9), (1.2, 0.0, -2.9), (1.5, 0.0, -2.9), (2.5, 0.9, -2.9)), "walk")
    log = s.watch(s.Playground(front, behind), Tracker(), 2.9)
    assert len(ids_of(log, 0)) == len(ids_of(log, 1)) == 1
    assert ids_of(log, 0) != ids_of(log, 1)
    assert seen(log[-6:], 1) == 1.0


def test_person_who_waits_behind_a_pillar_stays_on_stage(stagecraft):
    """Otherwise the character would leave the stage for as long as its performer is hidden."""
    s = stagecraft
    walk = through((0.3, 1.0, -3.1), (1.0, 0.0, -3.1), (2.0, 0.0, -3.1), (2.7, -1.0, -3.1))
    pillar = s.Box((-0.32, 0.0, -2.4), (0.32, 2.4, -2.1))
    log = s.watch(s.Playground(s.Player(walk), boxes=lambda time: (pillar,)), Tracker(), 3.1)
    present = [len(bodies) for _, bodies, _ in log[APPEARS:]]
    assert present == [1] * len(present)
    assert len(ids_of(log, 0)) == 1
    assert seen(log[-12:], 0) == 1.0


def test_touching_people_stay_two(stagecraft):
    s = stagecraft
    left = s.Player(s.line((-0.7, -2.5), (-0.24, -2.5), 0.2, 1.0), "wave", s.Proportions(height=1.7))
    right = s.Player(s.line((0.7, -2.55), (0.24, -2.55), 0.2, 1.0), "idle", s.Proportions(height=1.8))
    log = s.watch(s.Playground(left, right), Tracker(), 2.0)
    assert len(ids_of(log, 0)) == len(ids_of(log, 1)) == 1
    assert seen(log[APPEARS:], 0) == seen(log[APPEARS:], 1) == 1.0
    assert most(log) == 2


def test_two_who_come_in_joined_at_the_hand_are_two(stagecraft):
    s = stagecraft
    left = s.Player(s.line((-0.33, -2.6), (-0.33, -2.6), 0, 1), "idle", s.Proportions(height=1.75))
    right = s.Player(s.line((0.33, -2.6), (0.33, -2.6), 0, 1), "idle", s.Proportions(height=1.7))
    hands = lambda time: (s.Box((-0.12, 0.72, -2.66), (0.12, 0.8, -2.58)),)  # noqa: E731
    log = s.watch(s.Playground(left, right, boxes=hands), Tracker(), 0.5)
    assert len(ids_of(log, 0)) == len(ids_of(log, 1)) == 1
    assert seen(log[JOINED:], 0) == seen(log[JOINED:], 1) == 1.0


@pytest.mark.slow
def test_returning_person_is_reidentified(stagecraft):
    """They return in the opposite order."""
    s = stagecraft
    out_first = through((0.5, 0.4, -2.5), (1.4, 2.4, -2.5), (3.8, 2.4, -2.5), (4.8, 0.5, -2.5))
    back_first = through((0.8, -0.5, -2.6), (2.0, 2.4, -2.6), (2.4, 2.4, -2.6), (3.6, -0.5, -2.6))
    tall = s.Player(out_first, "walk", s.Proportions(height=1.85))
    small = s.Player(back_first, "walk", s.Proportions(height=1.65))
    tracker = Tracker()
    log = s.watch(s.Playground(tall, small), tracker, 5.2)
    assert all(who == [None, None] for time, _, who in log if 2.1 < time < 2.35)
    assert len(ids_of(log, 0)) == len(ids_of(log, 1)) == 1
    assert ids_of(log, 0) != ids_of(log, 1)
    assert seen(log[-8:], 0) == seen(log[-8:], 1) == 1.0


@pytest.mark.slow
def test_person_returning_too_late_gets_a_new_identity(stagecraft):
    s = stagecraft
    there = s.during(s.still(0.0, -2.5), (0.0, 1.0), (2.5, 9.0))
    settings = TrackerSettings(people=PeopleSettings(remember=0.5))
    log = s.watch(s.Playground(s.Player(there)), Tracker(settings), 3.2)
    assert len(ids_of(log, 0)) == 2
    log = s.watch(s.Playground(s.Player(there)), Tracker(), 3.2)
    assert len(ids_of(log, 0)) == 1


@pytest.mark.slow
def test_person_occluded_from_the_start_is_found_on_appearing(stagecraft):
    s = stagecraft
    front = s.Player(s.still(0.0, -2.2), "idle", s.Proportions(height=1.8))
    behind = s.Player(s.line((0.05, -3.2), (-0.95, -3.2), 0.5, 1.7), "walk", s.Proportions(height=1.7))
    log = s.watch(s.Playground(front, behind), Tracker(), 2.2)
    assert len(ids_of(log, 0)) == len(ids_of(log, 1)) == 1
    assert seen(log[-6:], 1) == 1.0


@pytest.mark.slow
def test_six_people_are_followed(stagecraft):
    s = stagecraft
    players = [
        s.Player(s.still(-1.2 + 0.42 * i, -2.3 - 0.4 * (i % 2)), "idle", s.Proportions(height=1.6 + 0.05 * i))
        for i in range(6)
    ]
    playground = s.Playground(*players)
    log = s.watch(playground, Tracker(), 1.6, start=4 / 30)
    assert most(log) == 6
    # The back row is half occluded and fitted in turn, so only positions are compared, not every joint.
    hips = [joints[0] for joints in playground.joints(1.5)]
    for _, bodies, _ in log[-20:]:
        assert [body.id for body in bodies] == [body.id for body in log[-1][1]]
        nearest = [np.argmin([np.linalg.norm(body.joints[0] - hip) for hip in hips]) for body in bodies]
        assert sorted(nearest) == [0, 1, 2, 3, 4, 5]


# --- objects that are not people ---


def chair(box, x, z):
    legs = [(x + a, z + b) for a in (-0.22, 0.18) for b in (-0.22, 0.18)]
    back = box((x - 0.22, 0.46, z - 0.22), (x + 0.22, 0.95, z - 0.18))
    seat = box((x - 0.22, 0.42, z - 0.22), (x + 0.22, 0.46, z + 0.22))
    return (seat, back, *(box((a, 0.0, b), (a + 0.04, 0.42, b + 0.04)) for a, b in legs))


def door(box, angle, hinge=(0.3, -3.3), width=0.8):
    boxes = []
    for r in np.arange(0.04, width, 0.08):
        x, z = hinge[0] + r * np.cos(angle), hinge[1] + r * np.sin(angle)
        boxes.append(box((x - 0.045, 0.0, z - 0.045), (x + 0.045, 2.0, z + 0.045)))
    return tuple(boxes)


def curtain(box, phase):
    wave = [0.06 * np.sin(2 * i + phase) for i in range(10)]
    return tuple(
        box((-1 + 0.1 * i, 0.05, -3.4 + d), (-0.895 + 0.1 * i, 2.2, -3.3 + d)) for i, d in enumerate(wave)
    )


@pytest.mark.slow
@pytest.mark.parametrize("thing", ["chair put down", "chair pushed", "table", "door", "curtain"])
def test_moving_furniture_is_not_a_person(stagecraft, thing):
    s = stagecraft
    table = (s.Box((0.0, 0.7, -3.0), (0.7, 0.74, -2.3)), s.Box((0.3, 0.0, -2.7), (0.4, 0.7, -2.6)))
    boxes = {
        "chair put down": lambda t: chair(s.Box, 0.3, -2.4) if t > 0.6 else (),
        "chair pushed": lambda t: chair(s.Box, round(min(0.6, t / 3), 2), -2.4) if t > 0.6 else (),
        "table": lambda t: table if t > 0.6 else (),
        "door": lambda t: door(s.Box, round(-0.2 + 0.6 * (1 - np.cos(2.5 * t)), 2)),
        "curtain": lambda t: curtain(s.Box, round(4 * t, 1)) if t > 0.6 else (),
    }[thing]
    log = s.watch(s.Playground(boxes=boxes), Tracker(), 2.0)
    assert most(log) == 0


@pytest.mark.slow
def test_chair_next_to_a_person_is_absorbed_and_the_person_is_not(stagecraft):
    """Five frames per second save time. A person who stands still for over a minute is not absorbed."""
    s = stagecraft
    boxes = lambda t: chair(s.Box, 0.7, -2.4) if t > 2.0 else ()  # noqa: E731
    tracker = Tracker()
    playground = s.Playground(s.Player(s.still(-0.3, -2.5)), boxes=boxes, noise=0.001)
    log = s.watch(playground, tracker, 65.0, fps=5)
    assert ids_of(log, 0) == {1}
    assert seen(log[1:], 0) == 1.0
    assert most(log) == 1
    empty = s.Playground(boxes=boxes).frame(66.0)
    view = tracker._mounting.view(dataclasses.replace(empty), no_people=False)
    x, z = view.points[..., 0], view.points[..., 2]
    on_chair = (np.abs(x - 0.7) < 0.3) & (np.abs(z + 2.4) < 0.3) & (view.points[..., 1] > 0.1)
    on_person = (np.abs(x + 0.3) < 0.15) & (z < -3.5) & (view.points[..., 1] > 0.5)
    room = tracker._room
    assert (room.z[on_chair] <= view.z[on_chair] + 0.2).all() and (room.z[on_chair] > 0).all()
    assert np.count_nonzero(on_person) > 50
    behind_person = room.z[on_person]
    assert ((behind_person == 0) | (behind_person > 3.0)).all()


# --- the sensor is moved ---


@pytest.mark.slow
def test_a_sensor_that_is_knocked_over_finds_the_floor_and_everybody_again(stagecraft):
    from enliven.camera import world_from_level_camera

    def mount(time):
        share = min(1.0, max(0.0, (time - 1.5) / 0.4))
        return world_from_level_camera(1.3 - 0.5 * share, np.deg2rad(6 - 8 * share), np.deg2rad(20) * share)

    s = stagecraft
    small = s.Player(s.still(-0.5, -2.7), "idle", s.Proportions(height=1.55))
    tall = s.Player(s.still(0.5, -2.7), "idle", s.Proportions(height=1.8))
    tracker = Tracker()
    log = s.watch(s.Playground(small, tall, mount=mount, told=False), tracker, 3.6)
    before, after = log[40][2], log[-1][2]
    assert None not in before
    assert after == before
    np.testing.assert_allclose(tracker.world_from_camera[:3, :3], mount(3.0)[:3, :3], atol=0.03)
    assert tracker.world_from_camera[1, 3] == pytest.approx(0.8, abs=0.05)


@pytest.mark.slow
def test_person_close_to_the_sensor_does_not_count_as_moved_sensor(stagecraft):
    s = stagecraft
    performer = s.Player(s.still(-0.4, -2.6))
    visitor = s.Player(s.during(s.line((0.9, -0.75), (-0.9, -0.75), 0.5, 1.5), (0.5, 1.5)))
    playground = s.Playground(performer, visitor, told=False)
    log = s.watch(playground, Tracker(), 2.2)
    assert ids_of(log, 0) == {log[APPEARS][2][0]}
    assert seen(log[-6:], 0) == 1.0
    # The pixels of the hidden performer must not be background, so the fit is exact again.
    for time, bodies, _ in log[-6:]:
        error = np.linalg.norm(bodies[0].joints - playground.joints(time)[0], axis=1)
        assert error.mean() < 0.05


# --- permission to perform ---


def test_person_outside_the_zone_is_a_bystander(stagecraft):
    s = stagecraft
    zone = ((-1.0, -3.0), (0.3, -3.0), (0.3, -2.0), (-1.0, -2.0))
    tracker = Tracker(TrackerSettings(scene=SceneSettings(zone=zone)))
    inside, outside = (
        s.Player(s.still(-0.4, -2.5)),
        s.Player(s.line((1.6, -2.5), (0.8, -2.5), 0.2, 1.0), "walk"),
    )
    log = s.watch(s.Playground(inside, outside), tracker, 1.4)
    assert seen(log[APPEARS:], 0) == 1.0
    assert seen(log, 1) == 0.0
    assert tracker.bystanders == 1


@pytest.mark.slow
def test_leaving_the_zone_stops_performing_and_keeps_identity(stagecraft):
    s = stagecraft
    zone = ((-1.2, -3.0), (0.3, -3.0), (0.3, -2.0), (-1.2, -2.0))
    tracker = Tracker(TrackerSettings(scene=SceneSettings(zone=zone)))
    walker = s.Player(
        through((0.4, -0.5, -2.5), (1.2, 0.9, -2.5), (1.8, 0.9, -2.5), (2.6, -0.5, -2.5)), "walk"
    )
    log = s.watch(s.Playground(walker), tracker, 3.2)
    assert seen([entry for entry in log if 1.3 < entry[0] < 1.7], 0) == 0.0
    assert len(ids_of(log, 0)) == 1
    assert seen(log[-5:], 0) == 1.0


@pytest.mark.slow
def test_when_locked_a_newcomer_is_a_bystander(stagecraft):
    s = stagecraft
    performer = s.Player(s.still(-0.5, -2.5))
    newcomer = s.Player(s.during(s.line((1.7, -2.6), (0.6, -2.6), 0.5, 1.3), (0.5, 9.0)), "walk")
    playground, tracker = s.Playground(performer, newcomer), Tracker()
    s.watch(playground, tracker, 0.5)
    tracker.lock()
    log = s.watch(playground, tracker, 1.3, start=0.5)
    assert seen(log, 1) == 0.0
    assert tracker.bystanders == 1
    tracker.unlock()
    log = s.watch(playground, tracker, 0.5, start=1.8)
    assert seen(log[-3:], 1) == 1.0
    assert tracker.bystanders == 0


def test_forgetting_drops_everybody_and_keeps_the_room(stagecraft):
    s = stagecraft
    playground, tracker = s.Playground(s.Player(s.still(0.0, -2.5))), Tracker()
    first = s.watch(playground, tracker, 1.2)
    room = tracker._room
    tracker.forget()
    assert tracker.performers == []
    again = s.watch(playground, tracker, 0.5, start=1.2)
    assert tracker._room is room
    assert seen(again[-3:], 0) == 1.0
    assert ids_of(again, 0) != ids_of(first, 0)


@pytest.mark.slow
def test_covered_lens_keeps_all_people(stagecraft):
    """The image is dark for a second. The same two people appear at once afterwards, and no joints are
    reported meanwhile.
    """
    s = stagecraft
    first = s.Player(s.still(-0.5, -2.5), "idle", s.Proportions(height=1.6))
    second = s.Player(s.still(0.5, -2.7), "wave", s.Proportions(height=1.8))
    playground, tracker, log = s.Playground(first, second), Tracker(), []
    for i in range(60):
        frame = playground.frame(i / 30)
        if 15 <= i < 45:
            frame = dataclasses.replace(frame, depth=np.zeros_like(frame.depth))
        log.append(tracker.track(frame))
    assert [[body.id for body in bodies] for bodies in log[APPEARS:]] == [[1, 2]] * (60 - APPEARS)
    assert max(body.confidence.max() for body in log[30]) == 0.0
    for joints in playground.joints(59 / 30):
        assert min(np.linalg.norm(body.joints - joints, axis=1).mean() for body in log[-1]) < 0.08
