"""Tests of calibrating and fusing two Kinects that saw the same people.

Several parameters were tuned on Study_24: the maximum distance between two bodies of one person, the
advantage of the previous assignment, and the plausible bone lengths. The low-pass filter of velocities was
tuned on Study_1. The Kinects' positions were not measured. The authors had already transformed the skeletons
into one world, so the resulting placement must be nearly the identity.
"""

import dataclasses
import os
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from fusion_measures import agreement, fuse_streams, jitter_mm

from enliven.frames import BodyFrame
from enliven.space.rigid_transform import (
    angle_between,
    compose_transform,
    invert,
    rotation_from_vector,
)
from enliven_edge.fusion.calibration.calibration import calibrate
from enliven_edge.fusion.calibration.quality import Verdict
from enliven_edge.fusion.calibration.tracks import stream_from_frames
from enliven_edge.fusion.live.fuser import Fuser
from enliven_edge.fusion.live.merge import sensor_positions, transform_bodies
from enliven_edge.fusion.settings import CalibrationSettings
from enliven_edge.importing.base import ImportOptions
from enliven_edge.importing.multitrack import MultiTrackReader

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
FOLDER = DATA / "skeletons" / "kinect_multitrack"
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not FOLDER.is_dir(), reason="the real recordings (ENLIVEN_DATA) are not here"),
]
KINECTS = ("138.251.207.136", "138.251.213.82")


@cache
def seen(study: int) -> dict[str, list[BodyFrame]]:
    """Returns each Kinect's frames with its own clock."""
    (path,) = FOLDER.glob(f"Study_{study}_*.csv")
    reader = MultiTrackReader()
    reader.clock = "Skeleton_Time"
    return {name: list(reader.read([path], ImportOptions(device=name))) for name in KINECTS}


def placed(frames: dict[str, list[BodyFrame]], overlap: float = 4.0):
    streams = [stream_from_frames(name, stream) for name, stream in frames.items()]
    return calibrate(streams, CalibrationSettings(overlap=overlap))


@cache
def performed(study: int):
    """Returns the calibration, the fused frames, and each Kinect's frames in the same world and clock."""
    calibration = placed(seen(study))
    space = calibration.space()
    both = list(fuse_streams(seen(study), space, Fuser(sensor_positions(space))))
    alone = {
        name: [
            BodyFrame(transform_bodies(f.bodies, place.level), f.time_ns + place.clock_offset_ns, name)
            for f in seen(study)[name]
        ]
        for name, place in space.sensors.items()
    }
    return calibration, both, alone


def test_two_people_who_occlude_each_other_place_two_kinects():
    """For Study_24, the Kinects' joints are 4 cm apart, and the placement is nearly that of the authors."""
    calibration, _, _ = performed(24)
    (pair,) = calibration.pairs
    assert calibration.is_good
    assert pair.quality.rms < 0.05
    assert pair.quality.swapped < 0.02
    assert pair.quality.seconds > 15
    pose = calibration.world_from_sensor[KINECTS[1]]
    assert np.linalg.norm(pose[:3, 3]) < 0.08
    assert np.degrees(angle_between(np.eye(4), pose)) < 3.5


@pytest.mark.parametrize("degrees", [75.0, -150.0])
def test_a_kinect_that_is_put_elsewhere_is_found_there(degrees):
    """The second Kinect's skeletons are moved elsewhere, and its clock is 1000 s ahead. The result must be
    the same.
    """
    before = made_of(24)
    placement = compose_transform(
        rotation_from_vector(np.deg2rad(degrees) * np.array([0.0, 1.0, 0.0])), np.array([1.0, 0.0, -2.5])
    )
    frames = dict(seen(24))
    frames[KINECTS[1]] = [
        dataclasses.replace(f, bodies=transform_bodies(f.bodies, placement), time_ns=f.time_ns + 1000 * 10**9)
        for f in frames[KINECTS[1]]
    ]
    after = placed(frames)
    assert after.is_good
    expected = before.world_from_sensor[KINECTS[1]] @ invert(placement)
    pose = after.world_from_sensor[KINECTS[1]]
    centre = np.array([0.0, 1.0, -2.4])
    assert np.linalg.norm((invert(expected) - invert(pose))[:3] @ [*centre, 1.0]) < 0.02
    assert np.degrees(angle_between(expected, pose)) < 0.5
    assert after.clock_offset_ns[KINECTS[1]] + 1000 * 10**9 == pytest.approx(
        before.clock_offset_ns[KINECTS[1]], abs=10e6
    )


def made_of(study: int):
    return performed(study)[0]


def test_two_people_keep_their_identities():
    """In 37 s with occlusion, collapsing skeletons and gaps of nine seconds, there are two people and no
    swap.
    """
    _, both, alone = performed(24)
    assert {body.id for frame in both for body in frame.bodies} == {1, 2}
    for frames in alone.values():
        apart, changes = agreement(both, frames)
        assert changes == 0
        assert apart < 45.0


def test_fused_kinects_see_second_person_longer_than_either():
    """The second person is visible for longer than in either Kinect alone."""
    _, both, alone = performed(24)

    def share(frames):
        return np.mean([len(frame.bodies) > 1 for frame in frames])

    assert share(both) > max(share(frames) for frames in alone.values()) + 0.02


@pytest.mark.parametrize("study", [1, 24])
def test_fusion_adds_little_jitter(study):
    """The Kinects' skeletons are smooth, and combining two clocks must not add jitter."""
    _, both, alone = performed(study)
    assert jitter_mm(both) < 1.35 * max(jitter_mm(frames) for frames in alone.values())


def test_standing_person_is_not_enough_to_place_a_sensor():
    """Study_1 (12 s, nearly in one place) and Study_14 (less than a second) are never accepted."""
    for study, overlap in ((1, 4.0), (14, 0.5)):
        calibration = placed(seen(study), overlap)
        assert not calibration.is_good
        assert calibration.pairs[0].quality.verdict is Verdict.WALK_ON
        assert "keep walking" in calibration.advice[0]


def test_one_person_before_two_kinects_is_one():
    _, both, _ = performed(1)
    counts = [len(frame.bodies) for frame in both]
    assert counts[5:] == [1] * (len(counts) - 5)
    assert {body.id for frame in both for body in frame.bodies} == {1}
