"""Tests of scanning a stool from above, where floor noise hides the camera's motion until fine alignment
runs.
"""

import pytest
from scanned_things import SCANNED_OBJECTS

from enliven.scanning import Scanner
from enliven.scanning.rigid import pose_difference
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan
from enliven_synthesis.sensor.profile import load_profile

PATH = HandheldPath(target=(0.0, 0.3, 0.0), radius=1.0, height=(0.3, 1.1), turns=1.1, seconds=15.0)
BEFORE, IMAGES = range(282, 297, 3), (297, 300, 303)
"""Image numbers that are fused at their true poses, and image numbers that are aligned to the last of
them.
"""
ELSEWHERE = 225
"""Number of an image from another side, 2 m away on the path, from which the images are also aligned."""


@pytest.mark.slow
def test_close_alignment_finds_pose_hidden_by_floor_noise():
    take, scanner = HandheldScan(SCANNED_OBJECTS["stool"](), load_profile("kinect1"), PATH), Scanner()
    for index in BEFORE:
        scanner.place(take.frame(index), take.pose(index))
    tracker, unsure = scanner.tracker, scanner.settings.tracking.unsure
    for index in IMAGES:
        view = scanner.prepare_view(take.frame(index))
        first = tracker.align(view, take.pose(BEFORE[-1]))
        close = tracker.align_closely(view, first.world_from_camera)
        off = [pose_difference(placed.world_from_camera, take.pose(index))[0] for placed in (first, close)]
        assert first.deviation > unsure, "what the thing tells is taken for noise"
        assert off[1] < 0.006 < off[0] and close.deviation < unsure
    wrong = tracker.align_closely(scanner.prepare_view(take.frame(ELSEWHERE)), take.pose(BEFORE[-1]))
    assert wrong.deviation > 1.0, "what is not found is not said to be"
