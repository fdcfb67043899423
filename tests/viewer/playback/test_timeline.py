"""Tests of the timeline and of its playhead."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document.character import Pose
from enliven.person.body import Body
from enliven_viewer.playback.playhead import PLAYBACK_SPEEDS, Playhead
from enliven_viewer.playback.timeline import NS_PER_S, CueFrame, Timeline
from enliven_viewer.settings import PlaybackSettings

FRAME = NS_PER_S // 30
some_times = st.lists(st.integers(0, 9 * NS_PER_S // 10), min_size=1, max_size=40)
actions = st.lists(
    st.one_of(
        st.tuples(st.just("advance"), st.floats(0, 3)),
        st.tuples(st.just("scrub"), st.floats(-1, 2)),
        st.tuples(st.just("step"), st.integers(-5, 5)),
        st.tuples(st.just("change_speed"), st.integers(-2, 2)),
        st.tuples(st.just("toggle_pause")),
        st.tuples(st.just("go_live")),
        st.tuples(st.just("arrive"), st.integers(1, 5)),
    ),
    max_size=30,
)


def pose(time_ns: int, x: float = 0.0, name: str = "chair") -> Pose:
    return Pose(name, time_ns, np.eye(3, dtype=np.float32)[None], np.array([[x, 0, 0]], np.float32))


def body(x: float, number: int = 1) -> Body:
    return Body(number, np.full((20, 3), x), np.ones(20))


def filled(count: int = 30) -> Timeline:
    timeline = Timeline()
    for k in range(count):
        timeline.add_pose(pose(k * FRAME, float(k)))
    return timeline


@given(some_times)
@settings(deadline=None, max_examples=60)
def test_moments_are_sorted_whatever_the_order_of_arrival(times: list[int]) -> None:
    timeline = Timeline()
    for t in times:
        timeline.add_pose(pose(t))
    walked = [timeline.start_ns]
    for _ in range(len(timeline) - 1):
        walked.append(timeline.neighbour(walked[-1], 1))
    assert walked == sorted(set(times))
    assert (timeline.start_ns, timeline.end_ns) == (min(times), max(times))


@given(actions, st.booleans())
@settings(deadline=None, max_examples=150)
def test_the_playhead_never_leaves_the_timeline(todo: list[tuple], loop: bool) -> None:
    timeline = filled()
    head, arrived = Playhead(timeline, loop=loop), 30
    for name, *arguments in todo:
        if name == "arrive":
            for _ in range(arguments[0]):
                timeline.add_pose(pose(arrived * FRAME))
                arrived += 1
        else:
            getattr(head, name)(*arguments)
        assert timeline.start_ns <= head.time_ns <= timeline.end_ns
        assert 0 <= head.fraction <= 1
        assert head.speed in PLAYBACK_SPEEDS
        assert head.moment() is not None
        assert not head.live or head.time_ns == timeline.end_ns


@given(st.floats(0, 1), st.floats(0, 10))
@settings(deadline=None, max_examples=60)
def test_scrubbing_shows_that_place_and_stays_there(fraction: float, seconds: float) -> None:
    head = Playhead(filled())
    head.scrub(fraction)
    shown = head.time_ns
    assert abs(head.fraction - fraction) < 1e-6
    head.advance(seconds)
    assert head.time_ns == shown


@given(st.floats(0, 5), st.integers(1, 6))
@settings(deadline=None, max_examples=60)
def test_new_poses_do_not_move_a_paused_playhead(seconds: float, count: int) -> None:
    timeline = filled()
    head = Playhead(timeline)
    head.toggle_pause()
    shown = head.time_ns
    for k in range(count):
        timeline.add_pose(pose((30 + k) * FRAME))
        head.advance(seconds)
    assert head.time_ns == shown
    head.go_live()
    assert head.time_ns == timeline.end_ns


@given(st.integers(0, 29), st.integers(0, 29))
@settings(deadline=None, max_examples=60)
def test_steps_there_and_back_are_undone(start: int, steps: int) -> None:
    head = Playhead(filled())
    head.scrub(0)
    head.step(start)
    head.step(min(steps, 29 - start))
    head.step(-min(steps, 29 - start))
    assert head.time_ns == start * FRAME


@given(st.sampled_from(PLAYBACK_SPEEDS), st.floats(0.001, 0.09))
@settings(deadline=None, max_examples=60)
def test_speed_is_sensor_seconds_a_second(speed: float, seconds: float) -> None:
    head = Playhead(filled(), live=False)
    head.speed = speed
    head.advance(seconds)
    assert abs(head.time_ns - seconds * speed * NS_PER_S) <= 1


def test_loop_continues_and_end_stops() -> None:
    looping, once = Playhead(filled(), live=False, loop=True), Playhead(filled(), live=False)
    for head in (looping, once):
        head.advance(29 / 30 + 0.1)
    assert abs(looping.time_ns - 0.1 * NS_PER_S) < 10
    assert once.time_ns == 29 * FRAME


def test_between_two_poses_lies_a_blend_and_across_a_gap_the_nearer_one() -> None:
    timeline = Timeline()
    for time_ns, x in ((0, 0.0), (FRAME, 1.0), (NS_PER_S, 2.0)):
        timeline.add_pose(pose(time_ns, x))
    places = [
        float(timeline.find_moment(t).poses["chair"].positions[0, 0])
        for t in (-5, FRAME // 2, FRAME + 9, NS_PER_S - 9, 2 * NS_PER_S)
    ]
    assert np.allclose(places, [0, 0.5, 1, 2, 2], atol=1e-6)


def test_poses_bodies_and_characters_of_one_time_share_a_moment() -> None:
    timeline = Timeline()
    timeline.add_pose(pose(5))
    timeline.add_bodies(5, [body(1.0)])
    timeline.add_pose(pose(5, name="horse"))
    moment = timeline.find_moment(5)
    assert len(timeline) == 1 and set(moment.poses) == {"chair", "horse"} and len(moment.bodies) == 1


def test_bodies_are_blended_by_identity() -> None:
    timeline = Timeline()
    timeline.add_bodies(0, [body(0.0, 1), body(5.0, 2)])
    timeline.add_bodies(FRAME, [body(1.0, 1), body(9.0, 3)])
    early, late = (timeline.find_moment(round(s * FRAME)).bodies for s in (0.25, 0.75))
    assert [b.id for b in early] == [1, 2] and [b.id for b in late] == [1, 3]
    assert abs(early[0].joints[0, 0] - 0.25) < 1e-6


def test_a_performer_is_seen_on_until_the_bodies_of_the_next_pose_are_here() -> None:
    timeline = Timeline()
    timeline.add_bodies(0, [body(1.0)])
    for step in (1, 2):
        timeline.add_pose(pose(step * FRAME))
    assert [len(timeline.find_moment(round(s * FRAME)).bodies) for s in (0.5, 1, 1.5, 2)] == [1] * 4
    timeline.add_bodies(FRAME, [])
    assert not timeline.find_moment(FRAME).bodies, "nobody is in view: that was said"
    timeline.add_pose(pose(2 * FRAME + round(timeline.settings.gap * 1e9)))
    assert not timeline.find_moment(timeline.end_ns).bodies, "those of long ago"


def test_cues_hold_from_their_moment_on() -> None:
    timeline = Timeline()
    timeline.add_pose(pose(0))
    timeline.add_pose(pose(FRAME))
    timeline.set_cues(CueFrame("chair", np.array([0], np.int32), np.ones(1, np.float32)))
    timeline.add_pose(pose(2 * FRAME))
    assert [timeline.find_moment(k * FRAME).possessed for k in range(3)] == [False, True, True]
    timeline.forget_cues("chair")
    timeline.add_pose(pose(3 * FRAME))
    assert [timeline.find_moment(k * FRAME).possessed for k in range(4)] == [False, True, False, False]


def test_memory_is_bounded_in_time_and_number() -> None:
    timeline = Timeline(PlaybackSettings(minutes=0.1, rate=10))
    for k in range(1000):
        timeline.add_pose(pose(k * FRAME))
        assert len(timeline) <= 60
        assert timeline.end_ns - timeline.start_ns <= 6 * NS_PER_S
    assert timeline.end_ns == 999 * FRAME


def test_a_clock_that_starts_again_starts_a_new_timeline_and_goes_live() -> None:
    timeline = filled(90)
    head = Playhead(timeline)
    head.scrub(0.5)
    timeline.add_pose(pose(0, 7.0))
    head.advance(0.01)
    assert len(timeline) == 1 and head.live and head.time_ns == 0


def test_a_late_pose_is_no_restart() -> None:
    timeline = filled(90)
    timeline.add_pose(pose(80 * FRAME + 5))
    assert len(timeline) == 91


def test_dropping_the_past_keeps_what_a_later_time_needs() -> None:
    timeline = filled()
    before = timeline.find_moment(10 * FRAME + 7).poses["chair"].positions
    timeline.drop_before(10 * FRAME + 7)
    assert timeline.start_ns == 10 * FRAME
    assert np.array_equal(timeline.find_moment(10 * FRAME + 7).poses["chair"].positions, before)


def test_an_empty_timeline_has_nothing_to_show() -> None:
    head = Playhead(Timeline())
    for act in (head.toggle_pause, head.go_live, lambda: head.scrub(0.3), lambda: head.step(1)):
        act()
        head.advance(1.0)
        assert head.moment() is None and head.time_ns == 0


def test_cues_belong_to_their_own_time() -> None:
    """Poses and bodies of a burst arrive before its cues, however late the cues are."""
    timeline = Timeline()
    for i in range(4):
        timeline.add_bodies(i * NS_PER_S, [])
    nodes, strengths = np.array([0], np.int32), np.ones(1, np.float32)
    timeline.set_cues(CueFrame("a", nodes, strengths, "preview"), 0)
    timeline.set_cues(CueFrame("a", nodes, strengths, "possessed"), 2 * NS_PER_S)
    assert [timeline.find_moment(i * NS_PER_S).possessed for i in range(4)] == [False, False, True, True]
    timeline.add_bodies(4 * NS_PER_S, [])
    assert timeline.find_moment(4 * NS_PER_S).possessed
