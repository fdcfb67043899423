"""Tests of the tracker on real depth: single-frame detection of eight arm poses, and a person who turns
around.

Both recordings were used in development to choose weights and hypotheses. These tests therefore detect
regressions, but say nothing about unseen people.
"""

import os
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from enliven.camera import Intrinsics, project
from enliven.frames import DepthFrame
from enliven.person.joints import Joint
from enliven_edge.importing.base import ImportOptions
from enliven_edge.importing.registry import find_files, find_reader
from enliven_edge.tracking.settings import SearchSettings, TrackerSettings
from enliven_edge.tracking.tracker import Tracker

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "tracking"))
from tracking_real import js6450

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not DATA.is_dir(), reason="the real recordings (ENLIVEN_DATA) are not here"),
]
UPPER = [Joint.HEAD, Joint.SHOULDER_LEFT, Joint.ELBOW_LEFT, Joint.SHOULDER_RIGHT, Joint.ELBOW_RIGHT]
AT_ONCE = TrackerSettings(search=SearchSettings(fits_per_frame=0))
APPEARS = 2
"""Number of frames within which people in the first frame are detected."""
JOINED = 8
"""Number of frames within which two people that hold hands are detected. They are first searched as one
person.
"""
HANDS = [Joint.WRIST_LEFT, Joint.WRIST_RIGHT]


@cache
def frames_of(folder: str) -> list[DepthFrame]:
    paths = find_files([DATA / folder])
    return list(find_reader(paths).read(paths, ImportOptions()))


drawn = cache(js6450)
"""Recordings of JS6450, read once for all tests of this file."""


def pixels_outside(frame: DepthFrame, tracker: Tracker, joints: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Returns the number of pixels by which each joint's projection is outside the mask."""
    camera_from_world = np.linalg.inv(tracker.world_from_camera)
    camera = joints @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    uv = np.round(project(camera, frame.intrinsics)).astype(int)
    uv = np.clip(uv, 0, [mask.shape[1] - 1, mask.shape[0] - 1])
    return ndimage.distance_transform_edt(~mask)[uv[:, 1], uv[:, 0]]


def test_arms_are_found_at_first_sight():
    """In eight single frames, head, shoulders and elbows lie on the person, and most wrists, too."""
    files = sorted((DATA / "depth" / "skeltrack_kinect1").glob("*.u16"))
    wrists = []
    for path in files:
        depth = np.fromfile(path, "<u2").reshape(480, 640)
        frame = DepthFrame(depth, Intrinsics(640, 480, 575.0, 575.0, 319.5, 239.5), 0, "kinect1")
        tracker = Tracker(AT_ONCE)
        (body,) = tracker.track(frame)
        near = (depth > 0) & (depth < 1800)
        outside = pixels_outside(frame, tracker, body.joints, near)
        assert outside[UPPER].max() < 12, path.name
        wrists += list(outside[HANDS])
    assert np.mean(np.array(wrists) < 15) >= 0.9


def test_still_seated_person_before_a_realsense_stays():
    """Two single frames of a room with many holes are repeated for a second each. Unknown background does not
    move.
    """
    folder = DATA / "depth" / "vcl3d_realsense_d415"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not here")
    for frame in frames_of("depth/vcl3d_realsense_d415"):
        tracker = Tracker()
        for n in range(30):
            bodies = tracker.track(replace(frame, time_ns=n * 33_333_333))
            assert [b.id for b in bodies] == [1] or n < APPEARS, f"frame {n}"
            assert not tracker.state.moved, f"frame {n}"


@pytest.mark.parametrize("way", [1, -1], ids=["as recorded", "mirrored"])
@pytest.mark.parametrize("start", [20, 50])
@pytest.mark.parametrize(
    ("settings", "appear"),
    [(AT_ONCE, 0), (TrackerSettings(), JOINED)],
    ids=["at once", "in a fifth of a second"],
)
def test_two_with_raised_and_held_hands_are_two_and_never_less(settings, appear, start, way):
    """The depth is drawn from another tracker's samples. Raised arms are not people, and joined hands hide
    neither person.
    """
    path = DATA / "skeletons" / "js6450_kinect2_json" / "2people_raise-both-arms-MIN.json"
    if not path.exists():
        pytest.skip(f"{path} is not here")
    real = drawn("js6450_two", path.name)
    tracker = Tracker(settings)
    for n, frame in enumerate(real.frames[start:]):
        shown = replace(frame, depth=np.ascontiguousarray(frame.depth[:, ::way]))
        ids = [body.id for body in tracker.track(shown)]
        assert ids == [1, 2] or n < appear, f"frame {start + n}"


@pytest.mark.parametrize("start", [0, 27, 51, 54])
def test_single_person_before_unmeasured_hall_is_detected(start):
    """Only the person has depth. A fringe that was learnt as background must not predict the rest of the
    background.
    """
    path = DATA / "skeletons" / "js6450_kinect2_json" / "1person_lift-both-legs-separate-MIN.json"
    if not path.exists():
        pytest.skip(f"{path} is not here")
    tracker = Tracker()
    for n, frame in enumerate(drawn("js6450_one", path.name).frames[start : start + 18]):
        assert len(tracker.track(frame)) == 1 or n < APPEARS, f"frame {start + n}"


def test_turning_person_is_tracked_all_round():
    """One hundred frames show a turn of about 345 degrees, upper body only, in front of a wall."""
    frames = frames_of("depth/uva_cv2_person_turn")
    tracker, yaws, inside = Tracker(), [], []
    for i, frame in enumerate(frames):
        bodies = tracker.track(frame)
        if i < APPEARS:
            continue
        assert len(bodies) == 1, f"frame {i}"
        assert bodies[0].id == 1
        posture = tracker.posture
        chest = posture.rotations[0] @ posture.rotations[1]
        yaws.append(np.arctan2(chest[0, 2], chest[2, 2]))
        if i % 10 == 0:
            path = DATA / "depth" / "uva_cv2_person_turn" / f"{i:010d}_mask.jpg"
            mask = np.asarray(Image.open(path).convert("L")) > 128
            inside.append(pixels_outside(frame, tracker, bodies[0].joints, mask)[UPPER])
    turned = np.degrees(np.unwrap(yaws))
    assert 310 < abs(turned[-1] - turned[0]) < 375
    assert np.abs(np.diff(turned)).max() < 40
    assert np.mean(np.array(inside) < 15) > 0.85


def test_driven_through_to_poses():
    """The real recording moves the chair. Its poses are finite, and the chair follows the head."""
    from enliven_edge.stage.character_setup import create_actor
    from enliven_edge.stage.stage import Stage

    tracker, stage = Tracker(), Stage([create_actor("chair", nodes=64)])
    heads, tops = [], []
    for i, frame in enumerate(frames_of("depth/uva_cv2_person_turn")[:60]):
        bodies = tracker.track(frame)
        (pose,) = stage.perform(bodies, frame.time_ns)
        assert np.isfinite(pose.positions).all()
        assert np.isfinite(pose.linear).all()
        if i == 10:
            stage.possess("chair", parts="upper body")
        if i > 30:
            heads.append(bodies[0].joints[Joint.HEAD])
            tops.append(pose.positions[np.argmax(stage.actors["chair"].graph.positions[:, 1])])
    apart = np.linalg.norm(np.diff(np.array(heads) - np.array(tops), axis=0), axis=1)
    assert np.median(apart) < 0.05
