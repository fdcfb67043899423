"""Tests of the crop box of a scan: its sides follow the pointer, never cross, and enclose the object."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from enliven.wire import SCAN, Scan, ScanMessage
from enliven_viewer.render.camera import OrbitCamera
from enliven_viewer.studio.app.viewport_input import MIDDLE_BUTTON, ViewportInput
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.scan.crop_box import CropBox, find_initial_box
from enliven_viewer.studio.features.scan.session import ScanSession
from enliven_viewer.studio.viewport.overlay import Disc, Line
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.studio.workspace.workspace import Workspace

SIDES = st.tuples(st.sampled_from([0, 1]), st.sampled_from([0, 1, 2]))


def lens_from(turn=0.0, up=0.0):
    camera = OrbitCamera()
    camera.frame((np.array([-1.0, 0.0, -1.0]), np.array([1.0, 1.5, 1.0])), 1.6, at_once=True)
    camera.orbit(turn, up)
    return Lens(camera.view(1.6), (800.0, 500.0))


def pixel(lens, point):
    (place,) = lens.project_visible(np.array([point]))
    return place


def middle_of(box, side):
    end, axis = side
    point = box.corners.mean(0)
    point[axis] = box.corners[end, axis]
    return point


@settings(max_examples=40)
@given(side=SIDES, share=st.floats(0.05, 3.0), turn=st.floats(-3, 3), up=st.floats(-0.4, 0.4))
def test_a_side_comes_to_where_the_pointer_is_and_the_others_stay(side, share, turn, up):
    box, lens = CropBox(), lens_from(turn, up)
    end, axis = side
    before, point = box.corners.copy(), middle_of(box, side)
    direction = np.eye(3)[axis]
    away = lens.view.eye - point
    if abs(away @ direction) > 0.98 * np.linalg.norm(away):
        return  # viewed along the line of motion: no pixel determines the distance
    other = before[1 - end, axis]
    wanted = point + (share - 1.0) * (point[axis] - other) * direction
    assert box.press(pixel(lens, point), lens)
    if box._held_handle != side:
        return  # another handle occludes this one
    box.drag(pixel(lens, wanted), lens)
    box.release()
    expected = before.copy()
    expected[end, axis] = wanted[axis]
    if abs(expected[end, axis] - other) < 0.02:
        expected[end, axis] = other + (0.02 if end else -0.02)
    np.testing.assert_allclose(box.corners, expected, atol=1e-6)
    assert not box.press((-500.0, -500.0), lens)


@settings(max_examples=40)
@given(
    drags=st.lists(st.tuples(SIDES, st.floats(0, 800), st.floats(0, 500)), max_size=8), turn=st.floats(-3, 3)
)
def test_box_never_turns_inside_out(drags, turn):
    box, lens = CropBox(), lens_from(turn)
    for side, x, y in drags:
        if box.press(pixel(lens, middle_of(box, side)), lens):
            box.drag((x, y), lens)
            box.release()
            if not lens.project_visible(box.corners[:1]) or np.abs(box.corners).max() > 3.0:
                break
    assert (np.diff(box.corners, axis=0) >= 0.02 - 1e-9).all()


@settings(max_examples=40)
@given(
    tilts=st.lists(st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)), min_size=2, max_size=2),
    moves=st.lists(st.tuples(*[st.floats(-1.0, 1.0)] * 3), min_size=2, max_size=2),
)
def test_box_follows_the_object_when_the_scans_pose_changes(tilts, moves):
    """Until then the scan's pose on the stage changes with the camera's offset from the object."""
    before, after = np.eye(4), np.eye(4)
    for place, (x, z), move in zip((before, after), tilts, moves, strict=True):
        place[:3, :3], place[:3, 3] = Rotation.from_euler("xz", [x, z]).as_matrix(), move
    box = CropBox()
    box.corners = np.array([[-0.2, 0.3, -0.3], [0.2, 0.9, 0.1]])
    world = np.linalg.inv(before)
    middle = world[:3, :3] @ box.corners.mean(0) + world[:3, 3]
    box.move_with_scan(before, after)
    np.testing.assert_allclose(box.corners.mean(0), after[:3, :3] @ middle + after[:3, 3], atol=1e-9)
    np.testing.assert_allclose(np.diff(box.corners, axis=0), [[0.4, 0.6, 0.4]], atol=1e-9)
    box.corners = np.array([[-0.2, 0.0, -0.3], [0.2, 0.9, 0.1]])
    box.move_with_scan(before, after)
    assert box.corners[0, 1] == 0.0 and box.corners[1, 1] >= 0.02, "what stands on the floor stands on it"


def test_initial_box_encloses_the_central_object():
    random = np.random.default_rng(0)
    thing = random.uniform([-0.3, 0.0, 0.1], [0.2, 0.9, 0.4], (4000, 3))
    floor = random.uniform([-3, -0.01, -3], [3, 0.01, 3], (4000, 3))
    cupboard = random.uniform([1.5, 0.0, 1.5], [2.0, 2.0, 2.0], (4000, 3))
    box = find_initial_box(np.concatenate([thing, floor, cupboard]))
    np.testing.assert_allclose(box, [[-0.32, 0.0, 0.08], [0.22, 0.92, 0.42]], atol=0.02)
    assert (np.diff(find_initial_box(floor), axis=0) > 0.5).all(), (
        "where nothing stands, one of a chair's size"
    )


class Client:
    """A client that records the session's requests."""

    def __init__(self):
        self.asked = []

    def ask(self, order, then):
        self.asked.append(order)

    def take(self, topic):
        return []

    def latest(self, topic):
        return {"": self.said} if topic is SCAN else {}


class Perform:
    """A link to an edge that never answers."""

    def __init__(self):
        self.client, self.active_workspace = Client(), "Perform"


def test_the_pointer_drags_it_before_any_tool_and_done_sends_it(tmp_path):
    editor = Editor()
    editor.size = (800.0, 500.0)
    editor.camera.frame((np.array([-1.0, 0.0, -1.0]), np.array([1.0, 1.5, 1.0])), 1.6, at_once=True)
    scan, passed = (
        ScanSession(editor, Perform()),
        ViewportInput(editor, Workspace.new(editor, tmp_path).actions),
    )
    passed.handles.append(scan)
    top = pixel(editor.lens, middle_of(scan.box, (1, 1)))
    scan.message = ScanMessage(number=1, phase="paused")
    yaw = editor.camera.view(1.6).camera_from_world.copy()
    passed.press(top)
    passed.release(top)
    assert (scan.box.corners[1] == [0.4, 1.0, 0.4]).all(), "it is not meant"
    scan.choose_kept_part("box")
    assert sum(isinstance(mark, Disc) for mark in scan.box.marks(editor.lens)) == 6
    assert sum(isinstance(mark, Line) for mark in scan.box.marks(editor.lens)) == 12
    passed.press(top)
    passed.move(pixel(editor.lens, [0.0, 0.6, 0.0]))
    passed.release(top)
    assert scan.box.corners[1, 1] == pytest.approx(0.6, abs=1e-6)
    np.testing.assert_array_equal(editor.camera.view(1.6).camera_from_world, yaw)
    corners = scan.box.corners.copy()
    passed.press(top, MIDDLE_BUTTON)
    passed.move((top[0], top[1] + 40.0))
    assert passed.busy
    np.testing.assert_array_equal(scan.box.corners, corners, "the middle button moves the camera")
    passed.release(top, MIDDLE_BUTTON)
    scan.finish()
    (order,) = scan.perform.client.asked
    assert order == Scan(
        "done", box=[-0.4, 0.0, -0.4, 0.4, order.box[4], 0.4], stage_from_scan=order.stage_from_scan
    )
    assert order.box[4] == pytest.approx(0.6, abs=1e-6) and len(order.stage_from_scan) == 12
    before = scan.box.corners.copy()
    moved = [1.0, 0, 0, 0.3, 0, 1, 0, 0, 0, 0, 1, -0.2]
    scan.perform.client.said = ScanMessage(number=1, phase="paused", stage_from_scan=moved)
    scan.advance()
    np.testing.assert_allclose(scan.box.corners, before + np.array([0.3, 0.0, -0.2]))
    scan.choose_kept_part("all")
    scan.finish()
    assert scan.perform.client.asked[-1] == Scan("done", whole=True)
