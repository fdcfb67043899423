"""Tests that a person who is connected to an object in the image is found in the person's own pixels."""

import numpy as np
import pytest

from enliven.person.joints import Joint
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.frame.observation import FrameView, WorkingCamera, world_points
from enliven_edge.tracking.people import follower
from enliven_edge.tracking.people.follower import Follower
from enliven_edge.tracking.segment.segmentation import pixels_near_bodies
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.tracker import Tracker

SETTINGS = TrackerSettings()
GOOD, HIPS_WITHIN = 0.6, 0.15
HEAD_WITHIN = 0.11
"""Maximum head error at first detection, before tracking, metres. It is 0.102 if first fits use half of the
points.
"""


def group(stagecraft, players=(), boxes=()):
    """Returns the view of people and boxes in the room, and the (h, w) pixels of people or boxes."""
    s = stagecraft
    camera = WorkingCamera(s.CAMERA, s.CAMERA.width)
    z = s.Playground(*players, boxes=lambda time: boxes).frame(0.0).depth / 1000.0
    empty = s.Playground().frame(0.0).depth / 1000.0
    view = FrameView(0, z, world_points(z, camera.ray, s.MOUNT), camera, s.MOUNT)
    before = (z > 0) & ((empty == 0) | (z < empty - 0.1))
    return view, before & (view.points[..., 1] > SETTINGS.scene.floor_band)


def detect(view, pixels):
    return Follower.detect(view, pixels, SETTINGS, Fitter(SETTINGS.fit))


@pytest.mark.parametrize(
    ("does", "x", "low", "high"),
    [
        ("idle", -0.2, (-0.08, 0.0, -2.7), (1.22, 0.5, -2.3)),
        ("wave", -0.2, (-0.1, 0.0, -2.7), (0.9, 0.4, -2.2)),
        ("idle", 0.0, (0.16, 0.0, -2.7), (1.16, 0.65, -2.4)),
    ],
)
def test_person_touching_a_table_is_detected(stagecraft, does, x, low, high):
    player = stagecraft.Player(stagecraft.still(x, -2.4), does)
    result = detect(*group(stagecraft, [player], (stagecraft.Box(low, high),)))
    assert result is not None
    who, how_well = result
    assert how_well > GOOD
    off = np.linalg.norm(who.posture.joints() - player.figure(0.0).joints, axis=1)
    assert off[Joint.HEAD] < HEAD_WITHIN
    assert off[Joint.HIP_CENTER] < HIPS_WITHIN


def test_table_touching_a_person_soon_becomes_background(stagecraft):
    """The table's edge touches the hip of a waving person. In the first second, it counts as an arm."""
    s = stagecraft
    low, high = (0.05, 0.6, -2.6), (0.6, 0.75, -2.3)
    playground = s.Playground(s.Player(s.still(-0.2, -2.4), "wave"), boxes=lambda time: (s.Box(low, high),))
    tracker, theirs = Tracker(), []
    for frame in range(36):
        tracker.track(playground.frame(frame / 30))
        points = tracker._view.points[tracker.owner >= 0]
        theirs.append(((points > np.array(low) - 0.05) & (points < np.array(high) + 0.05)).all(1).sum())
    assert max(theirs[:15]) > 500
    assert theirs[-1] < 0.2 * max(theirs[:15])


@pytest.mark.parametrize(
    ("low", "high"), [((-0.8, 0.0, -2.8), (0.8, 0.74, -2.4)), ((-0.5, 0.0, -2.7), (0.5, 0.5, -2.3))]
)
def test_table_carried_in_is_not_a_person(stagecraft, low, high):
    s = stagecraft
    table = lambda time: (s.Box(low, high),) if time > 0.5 else ()  # noqa: E731
    assert all(bodies == [] for _, bodies, _ in s.watch(s.Playground(boxes=table), Tracker(), 1.5))


def detections(monkeypatch, view, pixels, posture):
    """Returns the (h, w) masks that are searched for a person if all fits are bad, and the new track."""
    asked = []

    def detect(fitter, observation, *rest):
        asked.append(observation.view[1].copy())
        yield 1
        return posture, None

    monkeypatch.setattr(follower, "detect", detect)
    monkeypatch.setattr(follower, "fit_quality", lambda report: 0.0)
    settings = TrackerSettings(estimator=False)
    return asked, Follower.detect(view, pixels, settings, Fitter(settings.fit))


@pytest.fixture
def somebody(stagecraft):
    """Returns the view, pixels and posture of a person without neighbouring objects."""
    player = stagecraft.Player(stagecraft.still(0.0, -2.4), "idle")
    view, pixels = group(stagecraft, [player])
    return view, pixels, detect(view, pixels)[0].posture


def beside(pixels, share):
    """Adds pixels to the left of a person, so that the person is the fraction ``share`` of all."""
    more, (rows, columns) = pixels.copy(), np.nonzero(pixels)
    left = [(v, u) for u in range(columns.min() - 20, -1, -1) for v in range(rows.min(), rows.max())]
    for v, u in left[: round(len(rows) * (1.0 / share - 1.0))]:
        more[v, u] = True
    return more


def test_bad_fit_is_searched_again_in_pixels_near_the_body(monkeypatch, somebody):
    view, alone, posture = somebody
    pixels = beside(alone, 0.7)
    asked, none = detections(monkeypatch, view, pixels, posture)
    assert none is None
    assert len(asked) == 2
    np.testing.assert_array_equal(asked[0], pixels)
    np.testing.assert_array_equal(asked[1], pixels & pixels_near_bodies(view, [posture], 0.0, 0.12))
    np.testing.assert_array_equal(asked[1], alone)


@pytest.mark.parametrize("share", [0.4, 1.0])
def test_mostly_foreign_or_pure_group_is_not_searched_again(monkeypatch, somebody, share):
    view, alone, posture = somebody
    asked, none = detections(monkeypatch, view, beside(alone, share), posture)
    assert none is None
    assert len(asked) == 1
