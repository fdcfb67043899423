"""Tests of the synthetic sensor: its rate, its end, its ground truth, and its errors."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from enliven.camera import pixel_rays, unproject_depth
from enliven.errors import InputError
from enliven.person.body import Body
from enliven_edge.sensors.registry import open_sensor
from enliven_synthesis.sensor import synthetic
from enliven_synthesis.sensor.scene import cast_room
from enliven_synthesis.sensor.synthetic import SyntheticSensor


def nearest_to(body: Body, points: np.ndarray) -> np.ndarray:
    """Returns the (N,) distances from (N, 3) points to the nearest joint, metres."""
    return np.asarray(np.linalg.norm(points[:, None] - body.joints[None], axis=-1).min(1))


SMALL = {"width": 160, "realtime": False}


def test_frames_carry_the_camera_and_rising_times() -> None:
    with SyntheticSensor("oak-d", "wave", **SMALL) as sensor:
        frames = [sensor.read() for _ in range(4)]
    assert all(f is not None for f in frames)
    assert [f.time_ns for f in frames] == [0, 33_333_333, 66_666_667, 100_000_000]
    assert {f.sensor for f in frames} == {sensor.name} == {"synthetic OAK-D"}
    assert frames[0].depth.shape == (100, 160) and frames[0].intrinsics.fx == pytest.approx(441.25 / 4)
    assert frames[0].world_from_camera[1, 3] == pytest.approx(1.15)


@pytest.mark.parametrize(("noise", "share"), [(False, 100), (True, 90)])
def test_rendered_performer_agrees_with_the_truth(noise: bool, share: float) -> None:
    sensor = SyntheticSensor("kinect1", "idle", width=320, realtime=False, noise=noise)
    frame = sensor.read()
    assert frame is not None
    empty, _ = cast_room(frame.intrinsics, frame.world_from_camera)
    figure = (frame.depth > 0) & (frame.depth / 1000.0 < empty - 0.25)
    points = unproject_depth(frame.depth, pixel_rays(frame.intrinsics))[figure]
    world = points @ frame.world_from_camera[:3, :3].T + frame.world_from_camera[:3, 3]
    body = sensor.truth(frame.time_ns)
    assert figure.sum() > 4000
    nearest = nearest_to(body, world)
    assert np.percentile(nearest, share) < 0.27  # the middle of a thigh is that far from hip and knee
    assert np.percentile(world[nearest_to(body, world) < 0.3, 1], 99.9) == pytest.approx(1.75, abs=0.06)
    assert body.height == pytest.approx(1.75, abs=0.06)
    assert (body.confidence == 1).all()


def test_stream_ends_or_loops() -> None:
    sensor = SyntheticSensor("tof", "wave", width=80, realtime=False, loop=False)
    count = 0
    while sensor.read() is not None:
        count += 1
    assert count == sensor.studio.frames == 150
    assert sensor.read() is None
    looping = SyntheticSensor("tof", "wave", width=80, realtime=False, noise=False)
    first = looping.read()
    for _ in range(looping.studio.frames - 1):
        looping.read()
    again = looping.read()
    assert again.time_ns == 5_000_000_000
    assert np.abs(again.depth.astype(int) - first.depth).max() <= 1  # the same posture, later
    assert np.allclose(looping.truth(again.time_ns).joints, looping.truth(0).joints)


def test_the_same_options_give_the_same_frames() -> None:
    first, second, other = (
        SyntheticSensor("kinect2", "walk", seed=s, width=128, realtime=False) for s in (4, 4, 5)
    )
    for _ in range(3):
        a, b, c = first.read(), second.read(), other.read()
        assert (a.depth == b.depth).all() and (a.depth != c.depth).any()
    # The result does not depend on the frames that were read before.
    assert (first.studio.frame(40).depth == second.studio.frame(40).depth).all()


def test_in_real_time_a_frame_is_not_due_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    clock = SimpleNamespace(monotonic=lambda: now[0], sleep=lambda seconds: None)
    monkeypatch.setattr(synthetic, "time", clock)
    with SyntheticSensor("tof", "idle", width=80) as sensor:
        assert sensor.read() is not None
        with pytest.raises(TimeoutError, match="is due in"):
            sensor.read(0.0)
        now[0] += 2.05  # The reader was slow, so these frames are dropped.
        late = sensor.read()
        assert late.time_ns >= 2_000_000_000
    assert sensor.read() is None


def test_registry_opens_the_synthetic_sensor() -> None:
    sensor = open_sensor(
        "synthetic", profile="realsense-d415", choreography="idle", width=160, realtime=False
    )
    frame = sensor.read(0.1)
    assert frame.sensor == "synthetic RealSense D415"
    sensor.close()
    sensor.close()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"profile": "kinekt"}, "Did you mean 'kinect"),
        ({"choreography": "tango"}, "Known: chair"),
        ({"width": 321}, "does not divide the image size"),
        ({"width": 4}, "does not divide the image size"),
        ({"width": -5}, "outside"),
        ({"camera_hight": 1.0}, "Did you mean camera_height"),
        ({"camera_height": 99.0}, "outside"),
        ({"seed": "one"}, "seed"),
        ({"performer": {"height": 9.0}}, "performer.height"),
    ],
)
def test_wrong_options_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        SyntheticSensor(**{"realtime": False, **options})


def test_a_perfect_sensor_has_no_faults() -> None:
    frame = SyntheticSensor("kinect1", "idle", width=160, realtime=False, noise=False).read()
    assert (frame.depth > 0).all()
    assert len(np.unique(frame.depth)) > 400


def test_a_child_before_a_low_camera() -> None:
    sensor = SyntheticSensor(
        "kinect1", performer={"height": 1.1}, camera_height=0.6, camera_tilt=0.0, **SMALL
    )
    assert sensor.truth(0).height == pytest.approx(1.1, abs=0.12)
    assert sensor.read().world_from_camera[1, 3] == pytest.approx(0.6)
