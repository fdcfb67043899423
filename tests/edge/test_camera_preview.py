"""Tests of the camera preview: joints are drawn on the performer in the small depth image."""

from __future__ import annotations

import numpy as np
import pytest

from enliven.camera import Intrinsics
from enliven.frames import BodyFrame, DepthFrame
from enliven.person import Body
from enliven.rotation import from_rotation_vector
from enliven_edge.camera_preview import CameraPreview, encode_nearness
from enliven_viewer.studio.features.perform.preview_placement import find_aspect, project_bodies
from enliven_viewer.studio.viewport.preview_textures import draw_depth_image

LENS = Intrinsics(320, 240, 290.0, 290.0, 150.0, 118.0)
STEP = 100_000_000


def tilted() -> np.ndarray:
    """Returns a camera at 1.6 m that looks down by 20 degrees, along the world's -Z."""
    place = np.eye(4)
    place[:3, :3] = np.diag([1.0, -1.0, -1.0])
    place[:3, :3] = turned(-np.radians(20)) @ place[:3, :3]
    place[:3, 3] = [0.2, 1.6, 0.0]
    return place


def turned(angle: float) -> np.ndarray:
    half = from_rotation_vector(np.array([angle, 0.0, 0.0]))
    w, x, _, _ = half
    return np.array([[1, 0, 0], [0, 1 - 2 * x * x, -2 * x * w], [0, 2 * x * w, 1 - 2 * x * x]])


def body_and_depth(place: np.ndarray) -> tuple[Body, np.ndarray]:
    """Returns twenty joints, and a depth image with only one pixel at each joint."""
    rng = np.random.default_rng(3)
    joints = rng.uniform([-0.6, 0.3, -3.2], [0.6, 1.7, -2.4], (20, 3))
    depth = np.zeros((LENS.height, LENS.width), np.uint16)
    camera = (joints - place[:3, 3]) @ place[:3, :3]
    columns = np.round(LENS.fx * camera[:, 0] / camera[:, 2] + LENS.cx).astype(int)
    rows = np.round(LENS.fy * camera[:, 1] / camera[:, 2] + LENS.cy).astype(int)
    for row, column, away in zip(rows, columns, camera[:, 2], strict=True):
        depth[row - 4 : row + 5, column - 4 : column + 5] = round(1000 * away)
    return Body(1, joints, np.ones(20)), depth


@pytest.mark.parametrize("mirrored", [False, True])
def test_preview_joints_lie_on_the_image(mirrored) -> None:
    place = tilted()
    body, depth = body_and_depth(place)
    preview = CameraPreview().create_message(DepthFrame(depth, LENS, 0, "s"), place, mirrored=mirrored)
    assert preview is not None and find_aspect(preview) == pytest.approx(4 / 3, rel=0.02)
    if mirrored:  # mirrored in the vertical plane through the viewing direction
        body = Body(
            1, np.stack([2 * place[0, 3] - body.joints[:, 0], *body.joints.T[1:]], 1), body.confidence
        )
    (skeleton,) = project_bodies([body], preview)
    picture = np.frombuffer(preview.nearness, np.uint8).reshape(preview.height, preview.width)
    places = np.round(skeleton.places * preview.height - 0.5).astype(int)
    assert (picture[places[:, 1], places[:, 0]] > 0).all()
    near = 1 + 254 * np.clip((6000 - 1000 * skeleton.depth) / 5600, 0, 1)
    np.testing.assert_allclose(picture[places[:, 1], places[:, 0]], near, atol=30)


def test_preview_is_sent_every_other_frame_and_needs_a_pose() -> None:
    camera_preview, frame = (
        CameraPreview(),
        lambda n: DepthFrame(np.full((240, 320), 2000, np.uint16), LENS, n * STEP, "s"),
    )
    sent = [camera_preview.create_message(frame(n), tilted()) is not None for n in range(7)]
    assert sent == [True, False, True, False, True, False, True]
    assert CameraPreview().create_message(frame(0), None) is None
    preview = camera_preview.create_message(frame(0), tilted())
    assert preview is not None, "a recording begins anew"


def test_body_sensor_publishes_only_its_pose() -> None:
    preview = CameraPreview().create_message(BodyFrame([], 0, "kinect2"), tilted())
    assert preview is not None and preview.height == 0 and preview.nearness == b""
    assert preview.place == pytest.approx(tilted()[:3].ravel().tolist())


@pytest.mark.parametrize("size", [(480, 640), (424, 512), (576, 640), (120, 160), (50, 200), (1080, 1920)])
def test_any_image_becomes_a_small_picture(size) -> None:
    depth = np.random.default_rng(0).integers(0, 9000, size).astype(np.uint16)
    depth[0, 0], depth[0, -1] = 0, 65535
    small = encode_nearness(depth)
    assert small[0, 0] == 0 and max(small.shape) <= 128 and small.shape[0] <= 72
    preview = CameraPreview().create_message(
        DepthFrame(depth, Intrinsics(size[1], size[0], 300, 300, 5, 5), 0, "s"), tilted()
    )
    assert preview is not None and draw_depth_image(preview).shape == (*small.shape, 3)
