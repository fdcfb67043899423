"""Tests of pinned feet: still while they stand, free in the air, on limbs of any number of bones."""

import numpy as np
import pytest
from layer_edits import set_layer
from motion_strategies import EYE, angle
from tolerances import are_alike

from enliven.document.clip import Clip
from enliven.document.pin import ContactSettings
from enliven.document.project import Project
from enliven.document.rigged import still_shape
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.motion.contact.foot_lock import AnalysisWindow, find_analysis_window
from enliven.motion.contact.pin import find_bend, pin_feet, resolve_pins, unpin
from enliven.motion.layers.evaluate import Player
from enliven.motion.layers.retarget import bind_chain, set_travel
from enliven.rotation import from_rotation_vector, rotate

NAMES = ("hips", "hip L", "knee L", "ankle L", "toe L", "hip R", "knee R", "ankle R", "toe R")
PARENTS = np.array([-1, 0, 1, 2, 3, 0, 5, 6, 7], np.int32)
LEFT = np.array([[0.1, 0.9, 0], [0.1, 0.48, 0.02], [0.1, 0.06, 0], [0.1, 0.02, 0.12]])
REST = np.concatenate([[[0, 0.95, 0]], LEFT, LEFT * [-1, 1, 1]])
WALKER = Skeleton(NAMES, PARENTS, REST)
STEP = 1 / 30
FIRM = ContactSettings(rise=0.0)
FEET = ["ankle L", "ankle R"]


def walk(frames=91, slide=0.15):
    """Returns a walk with slightly bent knees, in which feet slide by a fraction of the step length."""
    t = np.arange(frames) * STEP
    turns = np.tile(EYE, (frames, 9, 1))
    for side, phase in ((1, 0.0), (5, np.pi)):
        swing = 0.3 * np.sin(2 * np.pi * t + phase)
        bend = 0.35 + 0.5 * np.clip(np.cos(2 * np.pi * t + phase), 0, None) ** 2
        zero = np.zeros_like(t)
        turns[:, side + 1] = from_rotation_vector(np.stack([-swing - bend, zero, zero], 1))
        turns[:, side + 2] = from_rotation_vector(np.stack([-swing + bend, zero, zero], 1))
    size = 0.84 * np.cos(0.35)
    root = np.tile(REST[0], (frames, 1))
    root[:, 1] = 0.06 + 0.05 + size * np.cos(0.3 * np.sin(2 * np.pi * t))
    root[:, 2] += (1 + slide) * 4 * size * np.sin(0.3) * t
    return Clip("walk", WALKER, turns, root, STEP)


def walking(clip, shape=None):
    """Returns a project in which a shape walks."""
    shape = shape or still_shape("walker", WALKER)
    project = Project().with_takes(clip).with_characters(shape)
    for side in (1, 5):
        chain = tuple(range(side, side + 4))
        project = bind_chain(project, "walker", chain, "walk", chain, basis=EYE, layer_id=f"leg {side}")
    return set_travel(project, "walker", "leg 1")


TIMES = np.arange(0, 3.0, 1 / 60)


def slides(player, contacts, name):
    """Returns the largest movement of a joint within each of its contacts, metres."""
    joint = NAMES.index(name)
    joints = player.sample(TIMES)[1][:, joint]
    inside = [(a <= TIMES) & (b >= TIMES) for a, b in zip(contacts.starts, contacts.ends, strict=True)]
    return [np.ptp(joints[some], axis=0).max() for some in inside if some.any()]


def test_sliding_feet_are_pinned():
    project = walking(walk())
    pinned = pin_feet(project, "walker", FEET, settings=FIRM)
    player = Player(pinned, "walker")
    contacts = player.contacts()
    assert set(contacts) == {"ankle L", "ankle R"}
    for name, contact in contacts.items():
        assert 3 <= len(contact.starts) <= 5
        assert max(slides(Player(project, "walker"), contact, name)) > 0.03
        assert max(slides(player, contact, name)) < 1e-6
    # Bones keep their lengths, the toes their rotation, and the trunk and the free feet their paths.
    (turns, joints), (old, before) = player.sample(TIMES), Player(project, "walker").sample(TIMES)
    for j in range(1, 9):
        link = rotate(turns[:, j], WALKER.vectors[j])
        np.testing.assert_allclose(joints[:, j] - joints[:, PARENTS[j]], link, atol=1e-9)
    assert are_alike(joints[:, 0], before[:, 0]) and angle(turns[:, 4], old[:, 4]) < 1e-9
    blend = ContactSettings().blend
    contact = contacts["ankle L"]
    free = np.all(
        [
            (a - blend > TIMES) | (b + blend < TIMES)
            for a, b in zip(contact.starts, contact.ends, strict=True)
        ],
        0,
    )
    assert free.any() and np.abs(joints[free, 3] - before[free, 3]).max() < 1e-9


def test_a_heel_rises_where_the_foot_stands_but_does_not_slide_or_sink():
    project = walking(walk())
    player = Player(pin_feet(project, "walker", FEET), "walker")
    after, before = player.sample(TIMES)[1], Player(project, "walker").sample(TIMES)[1]
    for name, contact in player.contacts().items():
        joint = NAMES.index(name)
        for a, b, place in zip(contact.starts, contact.ends, contact.places, strict=True):
            inside = (a <= TIMES) & (b >= TIMES)
            assert np.abs((after[inside, joint] - place)[:, [0, 2]]).max(initial=0) < 1e-6
            expected = np.maximum(before[inside, joint, 1], place[1])
            np.testing.assert_allclose(after[inside, joint, 1], expected, atol=1e-6)


def test_a_foot_that_may_sink_keeps_its_height_and_is_held_along_the_floor_only():
    project = walking(walk())
    player = Player(pin_feet(project, "walker", FEET, settings=ContactSettings(sink=1.0)), "walker")
    after, before = player.sample(TIMES)[1], Player(project, "walker").sample(TIMES)[1]
    for name, contact in player.contacts().items():
        joint = NAMES.index(name)
        for a, b, place in zip(contact.starts, contact.ends, contact.places, strict=True):
            inside = (a <= TIMES) & (b >= TIMES)
            assert np.abs((after[inside, joint] - place)[:, [0, 2]]).max(initial=0) < 1e-6
            np.testing.assert_allclose(after[inside, joint, 1], before[inside, joint, 1], atol=1e-6)


@pytest.mark.parametrize("rise", [0.0, 1.0])
def test_pinned_motion_has_no_jump(rise):
    project = pin_feet(walking(walk()), "walker", FEET, settings=ContactSettings(rise=rise))
    fine = np.arange(0, 3.0, 1 / 600)
    pinned, free = (
        Player(project, "walker").sample(fine)[1],
        Player(project, "walker").sample_unpinned(fine)[1],
    )
    for joint in (0, 2, 3):
        steps = np.linalg.norm(np.diff(pinned[:, joint], axis=0), axis=1)
        # Within the blend, the foot compensates for its sliding. It moves no faster than that.
        assert steps.max() < np.linalg.norm(np.diff(free[:, joint], axis=0), axis=1).max() + 0.002


def test_pinned_pose_at_one_time_matches_sampled_poses():
    project = pin_feet(walking(walk()), "walker", FEET)
    turns, joints = Player(project, "walker").sample(TIMES)
    player = Player(project, "walker")
    for i in (0, 40, 77, 130):
        at = player.compute_pose(TIMES[i])
        assert angle(at.turns, turns[i]) < 1e-12
        np.testing.assert_allclose(at.joints, joints[i], atol=1e-12)


def rising():
    """Returns a walker that stands while its root rises by 2 cm, more than its legs can extend."""
    root = REST[0] + np.linspace(0, 1, 31)[:, None] * [0, 0.02, 0]
    return walking(Clip("walk", WALKER, np.tile(EYE, (31, 9, 1)), root, STEP))


def test_a_stretched_limb_reaches_as_far_as_it_can():
    # The hips may not be lowered. The stretched leg points to the foot's position, and nothing breaks.
    how = ContactSettings(rise=0.0, drop=0.0)
    player = Player(pin_feet(rising(), "walker", ["ankle L"], settings=how), "walker")
    turns, joints = player.sample(np.linspace(0, 1, 13))
    size = WALKER.lengths[2] + WALKER.lengths[3]
    place = player.contacts()["ankle L"].places[0]
    expected = np.minimum(np.linalg.norm(place - joints[:, 1], axis=1), size)
    assert expected[-1] == size
    np.testing.assert_allclose(np.linalg.norm(joints[:, 3] - joints[:, 1], axis=1), expected, atol=1e-9)
    assert np.isfinite(turns).all()


def test_the_root_comes_down_for_a_foot_that_would_not_reach():
    player = Player(pin_feet(rising(), "walker", ["ankle L"], settings=FIRM), "walker")
    joints = player.sample(np.linspace(0, 1, 13))[1]
    place = player.contacts()["ankle L"].places[0]
    np.testing.assert_allclose(joints[:, 3], np.tile(place, (13, 1)), atol=1e-9)
    down = Player(rising(), "walker").sample(np.linspace(0, 1, 13))[1][:, 0] - joints[:, 0]
    assert not down[:, [0, 2]].any() and (down[:, 1] >= 0.0).all() and 0.0 < down[-1, 1] < 0.02
    # The unpinned foot is lowered together with the hips.
    assert joints[-1, 7, 1] == pytest.approx(0.06 + 0.02 - down[-1, 1])


def test_a_node_more_in_the_thigh_changes_nothing_of_the_foot():
    positions = np.insert(REST, 2, (REST[1] + REST[2]) / 2, axis=0)
    names = (*NAMES[:2], "thigh L", *NAMES[2:])
    parents = np.array([-1, 0, 1, 2, 3, 4, 0, 6, 7, 8], np.int32)
    finer = still_shape("walker", Skeleton(names, parents, positions))
    clip = walk()
    project = Project().with_takes(clip).with_characters(finer)
    for ours, theirs in (((1, 2, 3, 4, 5), (1, 2, 3, 4)), ((6, 7, 8, 9), (5, 6, 7, 8))):
        project = bind_chain(project, "walker", ours, "walk", theirs, basis=EYE, layer_id=str(ours))
    project = set_travel(project, "walker", "(6, 7, 8, 9)")
    with_hip = pin_feet(project, "walker", ["ankle L"], start="hip L", settings=FIRM)
    player = Player(with_hip, "walker")
    contact = player.contacts()["ankle L"]
    at = player.sample(TIMES)[1][:, 4]
    for a, b, place in zip(contact.starts, contact.ends, contact.places, strict=True):
        inside = (a <= TIMES) & (b >= TIMES)
        assert np.abs(at[inside] - place).max(initial=0) < 1e-6


def test_a_looped_walk_stands_in_every_round():
    project = walking(walk(31))
    for name in ("leg 1", "leg 5"):
        project = set_layer(project, "walker", name, loop=True)
    player = Player(pin_feet(project, "walker", FEET), "walker")
    times = np.linspace(0.01, 0.99, 50)
    (a, x), (b, y) = player.sample(times), player.sample(times + 7.0)
    assert angle(a, b) < 1e-6
    # The walk continues in seven further rounds.
    clip = project.takes["walk"]
    np.testing.assert_allclose(
        y - x, np.broadcast_to([0, 0, 7 * np.ptp(clip.root[:, 2])], x.shape), atol=1e-6
    )
    assert any(len(c.starts) for c in player.contacts().values())


def test_analysis_window_covers_the_layers():
    project = walking(walk(31))
    (shape,) = project.shapes.values()
    layers = shape.layers
    assert find_analysis_window([], {}) == AnalysisWindow(0.0, 0.0, False)
    window = find_analysis_window(layers, project.takes)
    assert (window.start, window.looped) == (0.0, False) and window.end == pytest.approx(1.0)
    late = set_layer(project, shape.id, "leg 5", offset=2.0, speed=0.5, loop=True)
    window = find_analysis_window(late.shape(shape.id).layers, late.takes)
    assert not window.looped and window.end == 120.0
    np.testing.assert_array_equal(window.fold_times(np.array([-1.0, 500.0])), [-1.0, 500.0])
    np.testing.assert_allclose(
        AnalysisWindow(1.0, 3.0, True).fold_times(np.array([0.5, 1.0, 3.5])), [2.5, 1.0, 1.5]
    )


def test_pins_are_added_and_removed():
    project = walking(walk())
    pinned = pin_feet(project, "walker", [3, "ankle R"])
    assert [(pin.joint, pin.start) for pin in pinned.shape("walker").pins] == [
        ("ankle L", "hip L"),
        ("ankle R", "hip R"),
    ]
    firm = pin_feet(pinned, "walker", ["ankle L"], settings=ContactSettings(blend=0.5))
    assert [pin.settings.blend for pin in firm.shape("walker").pins] == [0.5, 0.12]
    assert [pin.joint for pin in unpin(pinned, "walker", ["ankle L"]).shape("walker").pins] == ["ankle R"]
    assert unpin(pinned, "walker").shape("walker").pins == ()
    # If an edit removed the joint, the pin is ignored.
    less = Skeleton(NAMES[:3], PARENTS[:3], REST[:3])
    assert resolve_pins(still_shape("less", less).with_changes(pins=pinned.shape("walker").pins)) == []


@pytest.mark.parametrize(
    ("joints", "start", "said"),
    [
        (["hip L"], None, "no limb with two bones"),
        (["ankle L"], "knee L", "no limb with two bones"),
        (["ankle L"], "hip R", "no limb with two bones"),
        (["tail"], None, "no joint 'tail'"),
        ([99], None, "joint 99 does not exist"),
    ],
)
def test_unpinnable_joint_is_refused(joints, start, said):
    with pytest.raises(InputError, match=said):
        pin_feet(walking(walk()), "walker", joints, start=start)


def test_bending_joint_of_a_limb():
    middle, side = find_bend(WALKER, (1, 2, 3))
    assert middle == 1 and np.allclose(side, [0, 0, 0.02], atol=1e-3)
    straight = Skeleton(
        tuple("abcd"),
        np.array([-1, 0, 1, 2], np.int32),
        np.array([[0, 3.0, 0], [0, 2, 0], [0, 1, 0], [0, 0.5, 0]]),
    )
    middle, side = find_bend(straight, (0, 1, 2, 3))
    assert middle == 1 and np.array_equal(side, [0, 0, 1])
