"""Tests of the inspection films: objects are drawn at their positions, and the file is a valid video."""

from __future__ import annotations

import builtins

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from enliven.camera import Intrinsics, project, world_from_level_camera
from enliven.errors import InputError, ResourceError
from enliven.film.writer import FilmWriter
from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven.recording import Recorder
from enliven_edge.commands.inspect import inspect
from enliven_edge.inspection.inspector import Inspector
from enliven_edge.inspection.picture import (
    confidence_colour,
    contact_sheet,
    depth_picture,
    depth_span,
    draw_bodies,
    tint_people,
)  # fmt: skip
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.body.performer import Performer
from enliven_synthesis.motion.choreographies import get_choreography
from enliven_synthesis.sensor.synthetic import SyntheticSensor

CAMERA = Intrinsics(320, 240, 290.0, 290.0, 159.5, 119.5)
MOUNT = world_from_level_camera(1.1, 0.05)
JOINTS = Performer().pose(get_choreography("idle").posture(0.0)).joints


def test_near_depth_is_bright_and_missing_depth_is_dark() -> None:
    depth = np.array([[0, 1000, 2000, 3000, 9000]], np.uint16)
    grey = depth_picture(depth, 1.0, 3.0)[0, :, 0].astype(int)
    assert grey[0] < grey[4] and grey[1] > grey[2] > grey[3] == grey[4]
    near, far = depth_span(depth)
    assert 0.9 < near < far
    assert depth_span(np.zeros((4, 4), np.uint16))[0] > 0


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_joints_are_drawn_where_they_are_seen(scale: float) -> None:
    black = np.zeros((round(240 * scale), round(320 * scale), 3), np.uint8)
    sure = np.ones(20)
    sure[[Joint.HAND_LEFT, Joint.WRIST_LEFT]] = 0.0
    picture = draw_bodies(black, [Body(7, JOINTS, sure)], CAMERA, MOUNT, scale)
    camera = (JOINTS - MOUNT[:3, 3]) @ MOUNT[:3, :3]
    uv = np.rint((project(camera, CAMERA) + 0.5) * scale).astype(int)
    head, hand = picture[uv[3, 1], uv[3, 0]], picture[uv[7, 1], uv[7, 0]]
    assert tuple(head) == confidence_colour(1.0)
    assert not hand.any()  # a ring marks a guessed joint and is not filled
    assert (picture.any(2).sum(0) > 0).sum() < 0.2 * picture.shape[1]


def test_person_behind_the_camera_is_not_drawn() -> None:
    black = np.zeros((240, 320, 3), np.uint8)
    assert not draw_bodies(black, [Body(1, JOINTS + np.array([0, 0, 9.0]), np.ones(20))], CAMERA, MOUNT).any()


def test_confidence_goes_from_red_through_yellow_to_green() -> None:
    assert confidence_colour(-1)[:2] == (255, 0)
    assert confidence_colour(0.5)[:2] == (255, 255)
    assert confidence_colour(2.0)[:2] == (0, 255)


def test_the_persons_pixels_are_tinted() -> None:
    picture, depth = np.full((8, 8, 3), 200, np.uint8), np.full((8, 8), 900, np.uint16)
    depth[0] = 0
    owner = np.full((4, 4), -1)
    owner[:, 2:] = 0
    out = tint_people(picture, owner, depth)
    assert (out[:, :4] == 200).all() and (out[0] == 200).all()
    assert (out[1:, 4:] != 200).any(2).all()


def test_a_sheet_holds_every_picture() -> None:
    pictures = [np.full((30, 40, 3), 20 * n + 10, np.uint8) for n in range(5)]
    sheet = contact_sheet(pictures, 2, 20)
    assert sheet.shape == (45, 40, 3)
    assert (
        sheet[5, 5, 0] == 10 and sheet[5, 25, 0] == 30 and sheet[35, 5, 0] == 90 and not sheet[35, 25].any()
    )


def test_a_film_can_be_watched(tmp_path) -> None:
    av = pytest.importorskip("av")
    path = tmp_path / "new" / "a.mp4"
    with FilmWriter(path, None, 25.0, 8.0) as film:
        for n in range(10):
            film.add(np.full((121, 161, 3), 20 * n, np.uint8))
    with av.open(str(path)) as file:
        pictures = [f.to_ndarray(format="rgb24") for f in file.decode(video=0)]
    assert len(pictures) == 10 and pictures[0].shape == (120, 160, 3)
    assert abs(int(pictures[9].mean()) - 180) < 12 and pictures[0].mean() < 12


def test_film_without_images_writes_no_file(tmp_path) -> None:
    with FilmWriter(tmp_path / "a.mp4", None, 25.0, 8.0):
        pass
    assert not (tmp_path / "a.mp4").exists()


def test_without_pyav_the_extra_is_named(tmp_path, monkeypatch) -> None:
    real = builtins.__import__

    def absent(name, *rest, **more):
        if name == "av":
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", absent)
    with pytest.raises(ResourceError, match=r"enliven-edge\[film\]"):
        FilmWriter(tmp_path / "a.mp4", None, 25.0, 8.0)


@pytest.mark.slow
def test_a_person_is_followed_in_the_pictures() -> None:
    inspector = Inspector(Tracker(), 320)
    with SyntheticSensor("tof", "wave", realtime=False) as sensor:
        pictures = [inspector.draw_frame(sensor.read()) for _ in range(40)]
    assert len(inspector.bodies) == 1
    last = pictures[-1].astype(int)
    green = (last[..., 1] > 200) & (last[..., 0] < 120) & (last[..., 2] < 120)
    assert green.sum() > 700  # bones with high confidence are green
    assert all(p.shape == (240, 320, 3) for p in pictures)


@pytest.mark.slow
def test_the_command_makes_a_film_and_a_sheet(tmp_path) -> None:
    import typer

    with SyntheticSensor("tof", "wave", realtime=False) as sensor, Recorder(tmp_path / "a.mcap") as recorder:
        for _ in range(14):
            recorder.write_frame(sensor.read())
    app = typer.Typer()
    app.command()(inspect)
    words = [str(tmp_path / "a.mcap"), "-o", str(tmp_path / "a.mp4"), "--sheet", str(tmp_path / "a.png")]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert "14 frames at 30 frames per second" in result.output
    assert Image.open(tmp_path / "a.png").size[0] == 4 * 480
    assert (tmp_path / "a.mp4").stat().st_size > 2000


def test_a_recording_of_skeletons_alone_is_refused(tmp_path) -> None:
    with Recorder(tmp_path / "a.mcap") as recorder:
        recorder.write_frame(BodyFrame([Body(1, JOINTS, np.ones(20))], 0, "s"))
    with pytest.raises(InputError, match="no depth frames"):
        inspect(tmp_path / "a.mcap", tmp_path / "a.mp4")
