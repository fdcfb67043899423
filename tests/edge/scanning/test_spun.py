"""Tests that a small chair on a turntable in a structured room is tracked apart from the room."""

from dataclasses import replace

import numpy as np
import pytest
from chair_on_turntable import CAMERA_PATH, HELD, ROOM, SCANNED_OBJECT, SETTLED

from enliven.scanning.objects.moved_scanner import MovedScanner, object_tracking_settings
from enliven.scanning.objects.moved_step import ObjectState
from enliven.scanning.rigid import invert_pose, pose_difference
from enliven.scanning.settings import ScanSettings, VolumeSettings
from enliven_edge.scanning.object_messages import describe_objects
from enliven_synthesis.sensor.hand_turned_object import HandTurnedPath
from enliven_synthesis.sensor.moved_object import MovedObjectScan
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.turntable_object import TurntablePath

IMAGES, TURNING = 85, 70
"""Number of images at 30 per second, and number of the first image in which the chair turns at full speed."""


@pytest.mark.slow
def test_spun_object_is_tracked_and_room_stays_still():
    take = MovedObjectScan(
        SCANNED_OBJECT, CAMERA_PATH, load_profile("kinect1"), SETTLED, room=ROOM, width=320
    )
    frames = [take.frame(index) for index in range(IMAGES)]
    frames[0] = replace(frames[0], world_from_camera=take.pose(0))
    scanner = MovedScanner(object_tracking_settings(ScanSettings()))
    steps = [scanner.add(frame) for frame in frames]
    assert all(step.state is ObjectState.RESTING for step in steps[:40]), "it stands at first"
    assert all(step.state is ObjectState.FOLLOWED for step in steps[TURNING:])
    turned = range(TURNING, IMAGES)
    pose = [invert_pose(take.object_pose(index)) @ take.pose(index) for index in turned]
    off = np.array(
        [pose_difference(steps[n].object_from_camera, true) for n, true in zip(turned, pose, strict=True)]
    )
    # Metres and radians. This camera's depth error is 4 mm there.
    assert np.median(off[:, 0]) < 0.015 and off[:, 0].max() < 0.06 and off[:, 1].max() < 0.06
    room = [
        pose_difference(steps[index].scan.world_from_camera, take.pose(index))[0] for index in range(IMAGES)
    ]
    # Surfaces that may start moving are not used for camera tracking, so the camera does not follow them.
    assert max(room) < 0.015, "the room does not turn with it"
    assert not any("objects are on the floor" in sentence for sentence in describe_objects(scanner)), (
        "what moved is the thing"
    )


@pytest.mark.slow
def test_object_picked_up_by_two_hands_is_tracked():
    """The object stands for 1.5 s, is picked up within the next second, and is then turned."""
    take = MovedObjectScan(
        SCANNED_OBJECT, HandTurnedPath(), load_profile("kinect1"), HELD, room=ROOM, width=320
    )
    scanner, off = MovedScanner(object_tracking_settings(ScanSettings())), list[float]()
    for index in range(0, 130, 2):
        frame = take.frame(index)
        step = scanner.add(frame if index else replace(frame, world_from_camera=take.pose(0)))
        if index >= 80:
            assert step.state is ObjectState.FOLLOWED
            true = invert_pose(take.object_pose(index)) @ take.pose(index)
            off.append(pose_difference(step.object_from_camera, true)[0])
    assert np.median(off) < 0.03 and max(off) < 0.06
    assert scanner.followed_images >= len(off)


def test_unmoved_object_is_reported_with_advice():
    take = MovedObjectScan(
        SCANNED_OBJECT, TurntablePath(begins=99.0), load_profile("kinect1"), SETTLED, room=ROOM, width=160
    )
    scanner = MovedScanner(object_tracking_settings(ScanSettings(volume=VolumeSettings(voxel=0.008))))
    steps = [scanner.add(take.frame(index)) for index in range(4)]
    assert all(step.state is ObjectState.RESTING for step in steps)
    assert scanner.settings.volume.voxel == 0.004, "coarser voxels know too little of a thing to follow it"
    assert describe_objects(scanner)[-1].startswith("No rotation was detected")
