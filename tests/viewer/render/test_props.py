"""Tests of props in the viewer: on the timeline, interpolated, read from a take, and in the image."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from enliven.document.character import Character
from enliven.document.props import BALL, BOX, Props
from enliven.recording import Recorder
from enliven.rotation import from_rotation_vector
from enliven.wire.convert import pose_to_message, props_to_message
from enliven.wire.convert_characters import character_to_message
from enliven.wire.posecode import PoseCodec
from enliven_viewer.link.take_feed import TakeFeed
from enliven_viewer.live.hud import HudState, list_state_lines
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.interpolation import blend_props
from enliven_viewer.playback.timeline import NS_PER_S, Timeline
from enliven_viewer.render.camera import OrbitCamera
from enliven_viewer.render.props import make_block_template, make_prop_rows
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import Scene, SceneStyle, make_scene


def loose(time_ns: int = 0, shift: float = 0.0, ids: tuple[int, ...] = (0, 1), turn: float = 0.0) -> Props:
    """Returns a box on the left and a ball on the right, or more of them."""
    count = len(ids)
    positions = np.array([[-0.5 + k, 0.2, shift] for k in range(count)])
    turns = np.tile(from_rotation_vector(np.array([0.0, turn, 0.0])), (count, 1))
    shapes = np.array([BOX, BALL] * count, np.uint8)[:count]
    colours = np.array([(200, 40, 40), (40, 200, 40)] * count, np.uint8)[:count]
    return Props(
        time_ns, np.array(ids), shapes, np.full((count, 3), 0.2, np.float32), colours, positions, turns, "x"
    )


def test_props_are_interpolated_by_id() -> None:
    before, after = loose(0, ids=(3, 4)), loose(100, 0.2, ids=(4, 3), turn=1.0)
    between = blend_props(before, after, 0.25, 25)
    assert between is not None and between.time_ns == 25 and between.ids.tolist() == [3, 4]
    # Prop 3 jumps a metre from left to right: it was reset and did not fly.
    np.testing.assert_allclose(between.positions, before.positions)
    near = blend_props(loose(0), loose(100, 0.2, turn=1.0), 0.25, 25)
    np.testing.assert_allclose(near.positions[:, 2], 0.05)
    np.testing.assert_allclose(
        near.turns, np.tile(from_rotation_vector(np.array([0, 0.25, 0])), (2, 1)), atol=1e-9
    )
    late = blend_props(loose(0), loose(100, 0.2, turn=1.0), 0.75, 75)
    np.testing.assert_allclose(late.positions[:, 2], 0.15)


def test_prop_in_one_moment_only_follows_the_nearer_moment() -> None:
    few, many = loose(ids=(1,)), loose(ids=(1, 2))
    assert len(blend_props(few, many, 0.4, 0)) == 1 and len(blend_props(few, many, 0.6, 0)) == 2
    assert blend_props(None, many, 0.1, 0) is many and blend_props(None, None, 0.1, 0) is None


def test_props_stay_until_their_next_message(box: Character) -> None:
    timeline = Timeline()
    timeline.add_props(loose(NS_PER_S))
    timeline.add_pose(box.rest_pose(NS_PER_S + NS_PER_S // 30))
    assert timeline.find_moment(timeline.end_ns).props is not None
    timeline.add_pose(box.rest_pose(3 * NS_PER_S))
    assert timeline.find_moment(3 * NS_PER_S).props is None, "long without a word: they are gone"


def test_props_are_read_back_from_a_take(tmp_path, box: Character) -> None:
    codec = PoseCodec(box)
    with Recorder(tmp_path / "take.mcap") as recorder:

        def put(topic: str, message: object, time_ns: int) -> None:
            data = msgspec.msgpack.encode(message)
            recorder.write(topic, f"enliven.{topic}", "{}", "jsonschema", "msgpack", data, time_ns)

        put("character", character_to_message(box, 1), 0)
        for k in range(5):
            put("pose", pose_to_message(box.rest_pose(k * NS_PER_S), codec, revision=1), k * NS_PER_S)
            put("props", props_to_message(loose(k * NS_PER_S, 0.1 * k)), k * NS_PER_S)
    document, take = Document(Timeline(bounded=False)), TakeFeed(tmp_path / "take.mcap")
    while take.poll(document):
        pass
    assert take.unreadable == 0 and len(document.timeline) == 5
    props = document.timeline.find_moment(3 * NS_PER_S).props
    np.testing.assert_allclose(props.positions, loose(0, 0.3).positions, atol=3e-4)
    assert props.note == "x"


@pytest.mark.parametrize("fineness", [2, 3, 6])
def test_a_template_is_closed_and_faces_outwards(fineness: int) -> None:
    vertices, faces = make_block_template(fineness)
    direction, corner = vertices[:, :3], vertices[:, 3:]
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, atol=1e-6)
    assert set(np.unique(corner)) == {-1.0, 1.0} and (direction * corner >= -1e-6).all()
    pulled = corner * 0.5 + 0.1 * direction
    a, b, c = pulled[faces].swapaxes(0, 1)
    volume = np.einsum("fa,fa->f", a, np.cross(b, c)).sum() / 6
    # The box has 1 m sides and bevels of 0.1. Its volume is slightly less than 1.2 cubed if no face is
    # missing.
    assert 1.6 < volume <= 1.2**3 + 1e-6


def test_rows_hold_what_the_shader_takes() -> None:
    props = loose(turn=0.5)
    props.positions[0, 1] = np.nan
    assert len(make_prop_rows(props, BOX)) == 0 and len(make_prop_rows(None, BALL)) == 0
    (row,) = make_prop_rows(props, BALL)
    np.testing.assert_allclose(row[:4], [0.5, 0.2, 0.0, 0.2], atol=1e-6)
    np.testing.assert_allclose(row[4:8], props.turns[1, [1, 2, 3, 0]], atol=1e-6)


def test_camera_frames_near_props_only(box: Character) -> None:
    document = Document()
    document.add_character(box)
    document.add_pose(box.rest_pose(0))
    alone = make_scene(document, document.timeline.find_moment(0), SceneStyle()).box
    document.add_props(loose())
    both = make_scene(document, document.timeline.find_moment(0), SceneStyle())
    assert both.box[0][0] < alone[0][0] and both.lit_box[0][0] < alone[0][0], "the box, at the left"
    assert both.box[1][0] == alone[1][0] < both.lit_box[1][0], "a ball has a shadow, but moves no camera"
    far = loose()
    far.positions[:] += [30.0, 0, 0]
    document.add_props(far)
    np.testing.assert_allclose(
        make_scene(document, document.timeline.find_moment(0), SceneStyle()).box, alone
    )


def test_boxes_and_balls_are_drawn_and_cast_shadows(gl) -> None:
    renderer = Renderer(gl, (160, 120))
    camera = OrbitCamera(0.6)
    low, high = np.array([-1.0, 0.0, -0.6]), np.array([1.0, 0.8, 0.6])
    camera.frame((low, high), 4 / 3, at_once=True)
    view = camera.view(4 / 3)
    floor = drawn(renderer, Scene(), view)
    image = drawn(renderer, Scene(props=loose()), view)
    reddish = (image[..., 0] > 1.6 * image[..., 1]).sum()
    greenish = (image[..., 1] > 1.6 * image[..., 0]).sum()
    assert 200 < reddish < 6000 and 150 < greenish < reddish * 1.5
    grey = np.abs(image - image.mean(-1, keepdims=True)).max(-1) < 12
    assert ((floor.mean(-1) - image.mean(-1) > 12) & grey).sum() > 60, "there is no shadow on the floor"


def drawn(renderer: Renderer, scene: Scene, view) -> np.ndarray:
    renderer.draw(scene, view)
    return renderer.pixels().astype(float)


def test_score_is_shown_in_the_window() -> None:
    assert "chair hit twice" in list_state_lines(HudState(score="chair hit twice"))
    assert len(list_state_lines(HudState())) == len(list_state_lines(HudState(score="x"))) - 1


def test_distant_prop_leaves_the_framing_without_a_jump(box: Character) -> None:
    document = Document()
    document.add_character(box)
    rolled = loose(ids=(0,))
    widths = []
    for k in range(120):
        rolled.positions[:] = [[0.3 + 0.02 * k, 0.2, 0.0]]
        document.add_props(rolled)
        low, high = make_scene(document, document.timeline.find_moment(0), SceneStyle()).box
        widths.append(high[0] - low[0])
    assert max(np.abs(np.diff(widths))) < 0.021, "the box jumps"
    assert max(widths) > widths[0] + 0.5 and widths[-1] == pytest.approx(min(widths))
