"""Tests of a video file in place of a webcam. The landmarks are those of a performer that is not in the
video.
"""

import math
import time

import numpy as np
import pytest

from enliven.camera import world_from_level_camera
from enliven.errors import InputError, ResourceError
from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven_edge.landmarks.colour_pose import pinhole_camera
from enliven_edge.landmarks.source import NAMES, Landmarks
from enliven_edge.sensors.registry import open_sensor
from enliven_edge.sensors.webcam import WebcamSensor
from enliven_synthesis.sensor.synthetic import SyntheticSensor

av = pytest.importorskip("av")
MOUNT = world_from_level_camera(1.2)


class Truth:
    """A landmark source that returns the synthetic performer's projected joints for every image."""

    def __init__(self) -> None:
        self.sensor = SyntheticSensor(choreography="walk", realtime=False)
        self.images: list[tuple[tuple[int, ...], int]] = []
        self.closed = False

    def joints(self, time_ns: int) -> np.ndarray:
        return self.sensor.truth(time_ns).joints

    def find(self, colour: np.ndarray, time_ns: int) -> list[Landmarks]:
        self.images.append((colour.shape, int(colour.mean())))
        camera = pinhole_camera(colour.shape[1], colour.shape[0], math.radians(65))
        local = (self.joints(time_ns) - MOUNT[:3, 3]) @ MOUNT[:3, :3]
        places = np.tile(local[Joint.HEAD], (len(NAMES), 1))
        for landmark, joint in zip(
            (11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 23, 24, 25, 26, 27, 28, 31, 32),
            (4, 8, 5, 9, 6, 10, 7, 11, 7, 11, 12, 16, 13, 17, 14, 18, 15, 19),
            strict=True,
        ):
            places[landmark] = local[joint]
        points = places[:, :2] / places[:, 2:] * camera.fx + [camera.cx, camera.cy]
        return [Landmarks(points, np.ones(33), places - 0.5 * (places[23] + places[24]))]

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def film(tmp_path):
    """Writes a video of twelve grey images of increasing brightness, at 12 per second."""
    path = tmp_path / "film.mp4"
    with av.open(path, "w") as container:
        stream = container.add_stream("libx264", rate=12)
        stream.width, stream.height, stream.pix_fmt = 160, 120, "yuv420p"
        for i in range(12):
            grey = np.full((120, 160, 3), 20 * i, np.uint8)
            for packet in stream.encode(av.VideoFrame.from_ndarray(grey, format="rgb24")):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    return str(path)


def test_a_film_gives_the_bodies_of_its_images_at_their_times(film):
    truth = Truth()
    height = truth.sensor.truth(0).height
    frames: list[BodyFrame] = []
    with WebcamSensor(film, body_height=height, source=truth) as sensor:
        start = time.monotonic()
        while (frame := sensor.read()) is not None:
            frames.append(frame)
        assert time.monotonic() - start > 0.7, "a film is played at its own pace"
    assert truth.closed and sensor.read() is None
    assert [f.time_ns for f in frames] == pytest.approx([i * 1e9 / 12 for i in range(12)], abs=1e6)
    assert {shape for shape, _ in truth.images} == {(120, 160, 3)}
    np.testing.assert_allclose([grey for _, grey in truth.images], 20 * np.arange(12), atol=4)
    assert [body.id for f in frames for body in f.bodies] == [1] * 12
    for frame in frames:
        away = np.linalg.norm(frame.bodies[0].joints - truth.joints(frame.time_ns), axis=1)
        assert away.mean() < 0.12


def test_an_image_that_is_not_due_yet_is_kept_for_the_next_call(film):
    with WebcamSensor(film, source=Truth()) as sensor:
        assert sensor.read().time_ns == 0
        with pytest.raises(TimeoutError):
            sensor.read(0.01)
        assert sensor.read().time_ns == pytest.approx(1e9 / 12, abs=1e6)


def test_two_people_keep_their_ids(film):
    class Two(Truth):
        def find(self, colour, time_ns):
            (landmarks,) = super().find(colour, time_ns)
            other = Landmarks(
                landmarks.points + np.array([40.0, 0.0]), landmarks.visibility, landmarks.offsets
            )
            return [landmarks, other] if len(self.images) % 2 else [other, landmarks]

    places: dict[int, list[float]] = {}
    with WebcamSensor(film, source=Two()) as sensor:
        while (frame := sensor.read()) is not None:
            for body in frame.bodies:
                assert isinstance(body, Body)
                places.setdefault(body.id, []).append(float(body.joints[Joint.SHOULDER_CENTER, 0]))
    assert {i: len(x) for i, x in places.items()} == {1: 12, 2: 12}
    assert max(places[1]) < min(places[2])


def test_invalid_film_or_camera_is_reported(tmp_path):
    (tmp_path / "a.mp4").write_bytes(b"no film" * 100)
    with pytest.raises(InputError, match=r"a\.mp4"):
        open_sensor("webcam", device=str(tmp_path / "a.mp4"))
    with pytest.raises(
        ResourceError, match=r"video99: the camera was not found\. (Set device to one of|Plug in a camera)"
    ):
        open_sensor("webcam", device="/dev/video99")
    with pytest.raises(
        ResourceError, match=r"null: the camera cannot be opened .* Check that this is a camera"
    ):
        WebcamSensor("/dev/null", source=Truth())
    with pytest.raises(InputError, match="view"):
        open_sensor("webcam", device="/dev/video99", view=500.0)
