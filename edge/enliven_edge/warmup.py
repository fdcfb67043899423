"""Compiles every kernel of tracking before the first frame is due, so that no frame waits for a compiler."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from functools import cache

import numpy as np

from enliven.arrays import UInt16
from enliven.frames import DepthFrame
from enliven.recording import Recording
from enliven_edge.doctor import find_shipped_recording
from enliven_edge.tracking.detect.arm_starts import densest_ball
from enliven_edge.tracking.frame.reduction import measure_depth_image
from enliven_edge.tracking.scene.floor import correct_mounting, world_from_floor
from enliven_edge.tracking.settings import SceneSettings, TrackerSettings
from enliven_edge.tracking.tracker import Tracker

_STEP_NS = 33_333_333
"""Nanoseconds between the frames of a sensor at 30 Hz."""
_ONE_PERSON_FRAMES = 3
"""Number of frames with one person. The person is first new, then confirmed, then tracked."""
_TWO_PEOPLE_FRAMES = 3
"""Number of frames with two people who touch. The second person is new, then confirmed, then tracked."""
_EMPTY_FRAMES = 1
"""Number of frames without people, in which both people are lost."""
_EMPTY_ROOM_FRAMES = 3
"""Number of frames of an empty room. The background is unknown, then learnt, then extended to unseen
pixels."""
_EMPTY_ROOM_STEP_NS = 500_000_000
"""Nanoseconds between the frames of an empty room. The background is extended at most every 0.3 s."""
_WALL_MM = 2500
"""Depth of the empty room's wall in millimetres, within the range of every sensor."""
_PEOPLE_DISTANCE = 1 / 6
"""Distance of the two people as a fraction of the image width. It is small, so that region growing must
separate them."""


@cache
def warm_up_tracking(settings: TrackerSettings | None = None) -> None:
    """Tracks the start of the shipped recording: a person appears, then a second one, and both disappear.

    The compiled kernels stay in the process's memory. Repeated calls with the same settings do nothing.
    """
    settings = settings or TrackerSettings()
    # Use default settings for the scene, because the user's own mounting and zone would hide the recorded
    # person. Do not spread the search over frames, because the second person would be found too late.
    search = dataclasses.replace(settings.search, fits_per_frame=0)
    tracker = Tracker(dataclasses.replace(settings, scene=SceneSettings(), search=search))
    for frame in _warm_up_frames():
        measure_depth_image(frame.depth)  # The health monitor measures every frame.
        tracker.track(frame)
        tracker.surfaces()
    _compile_other_kernels()


@cache
def compile_scene_kernels() -> None:
    """Compiles the kernels of the background model and of the floor fit: a seventh of all tracker kernels.

    :func:`warm_up_tracking` needs them only after half of its time. So another process can compile them while
    this one compiles the kernels of the fit. Repeated calls do nothing.
    """
    frame = next(_recorded_frames())
    depth = np.full_like(frame.depth, _WALL_MM)
    depth[:, : depth.shape[1] // 4] = 0  # Pixels without depth, to which the background is extended.
    tracker = Tracker()
    for i in range(_EMPTY_ROOM_FRAMES):
        tracker.track(dataclasses.replace(frame, depth=depth, time_ns=i * _EMPTY_ROOM_STEP_NS))
    _compile_other_kernels()


def _recorded_frames() -> Iterator[DepthFrame]:
    """Yields the depth frames of the shipped recording."""
    return (frame for frame in Recording(find_shipped_recording()).frames() if isinstance(frame, DepthFrame))


def _warm_up_frames() -> Iterator[DepthFrame]:
    """Yields the frames to be tracked, with times at 30 frames per second."""
    count = _ONE_PERSON_FRAMES + _TWO_PEOPLE_FRAMES + _EMPTY_FRAMES
    for i, frame in zip(range(count), _recorded_frames(), strict=False):
        depth = frame.depth
        if i >= _ONE_PERSON_FRAMES:
            depth = _duplicate_person(depth)
        if i >= _ONE_PERSON_FRAMES + _TWO_PEOPLE_FRAMES:
            depth = np.zeros_like(depth)
        yield dataclasses.replace(frame, depth=depth, time_ns=i * _STEP_NS)


def _compile_other_kernels() -> None:
    """Compiles the kernels of the floor fit and the pose correction.

    The recorded sensor reports its pose, so tracking it does not use these kernels.
    """
    x, z = np.meshgrid(np.linspace(-1.0, 1.0, 40), np.linspace(1.0, 3.0, 40))
    world_from_floor(np.stack([x, np.ones_like(x), z], -1).reshape(-1, 3))
    correct_mounting(np.eye(4), np.stack([x, np.zeros_like(x), -z], -1), np.ones(x.shape, bool), 1.0)
    # The recorded person never points a forearm away from the body, so tracking would not run this kernel.
    # Call it directly.
    densest_ball(np.zeros((1, 3), np.float32), np.float32(1.0))


def _duplicate_person(depth: UInt16) -> UInt16:
    """Returns a depth image (H, W) that shows the person twice.

    It is the minimum of the image and a shifted copy.
    """
    moved = np.roll(depth, round(_PEOPLE_DISTANCE * depth.shape[1]), axis=1)
    return np.where((depth == 0) | ((moved > 0) & (moved < depth)), moved, depth)


if __name__ == "__main__":
    # A separate process runs this and fills the folder of compiled kernels. enliven_edge.commands.preparation
    # starts the process.
    warm_up_tracking()
