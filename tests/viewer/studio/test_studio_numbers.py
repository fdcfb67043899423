"""Tests of typed numbers (units and sums, positions, sizes, rotations), of snapping, and of camera
bookmarks.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from in_a_window import in_a_window
from made_acting_stage import acting_stage, pixel_on

from enliven.document.project import are_identical
from enliven.errors import InputError
from enliven.formats.project.file import read_project, write_project
from enliven.rotation import from_rotation_vector, rotate
from enliven_viewer.studio.app.quantity import ANGLE, LENGTH, PERCENTAGE, TIME
from enliven_viewer.studio.editor.snapping import Snapping
from enliven_viewer.studio.features.outliner.outliner import Outliner
from enliven_viewer.studio.workspace.workspace import Workspace

SESSION = Path(__file__).parents[1] / "studio_numbers_session.py"
QUANTITIES = (LENGTH, ANGLE, TIME, PERCENTAGE)
UNITS = [(quantity, unit) for quantity in QUANTITIES for unit in ("", *quantity.units)]


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    opened = acting_stage(tmp_path)
    opened.editor.frame_all(at_once=True)
    return opened


@given(st.sampled_from(QUANTITIES), st.floats(-1e4, 1e4))
def test_written_number_is_read_back(quantity, value) -> None:
    tolerance = 0.5 * 10**-quantity.digits + 1e-9
    assert quantity.parse_value(quantity.format_value(value)) == pytest.approx(value, abs=tolerance)


whole = st.integers(0, 10**6).map(lambda number: number / 1000)


@given(st.sampled_from(UNITS), st.sampled_from(UNITS), whole, whole, st.sampled_from("+-*/"))
def test_sums_and_units_are_those_of_python(one, other, a, b, sign) -> None:
    (quantity, first), (_, second) = one, (one[0], other[1] if other[1] in one[0].units else "")
    x, y = a * quantity.units.get(first, 1.0), b * quantity.units.get(second, 1.0)
    typed = f"-({a} {first} {sign} {b}{second})"
    if sign == "/" and y == 0.0:
        with pytest.raises(InputError, match="zero"):
            quantity.parse_value(typed)
        return
    wanted = {"+": x + y, "-": x - y, "*": x * y, "/": x / y if y else 0.0}[sign]
    assert quantity.parse_value(typed) == pytest.approx(-wanted, rel=1e-12)


def test_units_sums_and_percentages_are_read() -> None:
    assert (
        LENGTH.parse_value("50 cm") == 0.5
        and LENGTH.parse_value("1,5") == 1.5
        and LENGTH.parse_value("1.2+0.3") == 1.5
    )
    assert LENGTH.parse_value("2 m - 4cm * 2") == pytest.approx(1.92) and LENGTH.parse_value(".5M") == 0.5
    assert LENGTH.parse_value("150%", percent=0.02) == 3.0 and ANGLE.parse_value("90°") == 90.0
    assert (
        TIME.parse_value("250 ms") == 0.25
        and LENGTH.format_value(-0.0) == "0 m"
        and LENGTH.format_value(1.25) == "1.25 m"
    )


@example("²")
@example("2²")
@given(st.text(max_size=20))
def test_anything_else_is_refused_with_the_units(typed) -> None:
    try:
        assert math.isfinite(LENGTH.parse_value(typed))
    except InputError as error:
        assert "cm" in error.remedy


def test_typed_position_size_and_rotation_are_applied(workspace) -> None:
    editor, figures = workspace.editor, workspace.selection_transform
    for names in (("limb",), ("post",), ("limb", "post")):
        editor.choose_all(*names)
        figures.move_to(0, 1.25)
        figures.move_to(1, 0.0)
        assert np.allclose(figures.place[:2], [1.25, 0.0], atol=1e-5)
        before = figures.place
        figures.set_height(0.8)
        assert figures.height == pytest.approx(0.8, abs=1e-4)
        assert np.allclose(figures.place[1], before[1], atol=1e-4), "it goes on standing where it stands"
        earlier = [np.array(posed.vertices) for posed in editor.stage_characters if posed.id in names]
        place = figures.place
        figures.turn(1, 90.0)
        turn = from_rotation_vector(np.array([0.0, math.pi / 2, 0.0]))
        after = [np.array(posed.vertices) for posed in editor.stage_characters if posed.id in names]
        for old, new in zip(earlier, after, strict=True):
            assert np.allclose(place + rotate(turn, old - place), new, atol=1e-4)
    with pytest.raises(InputError, match="possible height"):
        figures.set_height(-1.0)
    workspace.state(Outliner).set_locked("post", is_locked=True)
    before = editor.project
    figures.move_to(0, 3.0)
    assert editor.project is before, "a locked one among them is not moved"


@given(
    st.tuples(*[st.floats(-5, 5)] * 3),
    st.tuples(*[st.floats(-5, 5)] * 3),
    st.floats(0.05, 1.0),
    st.floats(-7, 7),
)
def test_snapped_places_lie_on_the_grid_and_are_the_nearest(start, way, grid, radians) -> None:
    snapping = Snapping(True, grid)
    begin, wanted = np.array(start), np.array(way)
    end = begin + snapping.snap_offset(begin, wanted)
    moved = np.abs(wanted) > 1e-9
    steps = end / grid
    assert np.allclose(steps[moved], np.round(steps[moved]), atol=1e-6)
    assert (np.abs(end - begin - wanted) <= grid / 2 + 1e-9).all()
    assert np.allclose(end[~moved], (begin + wanted)[~moved])
    turned = snapping.snap_angle(radians)
    assert abs(turned - radians) <= math.radians(7.5) + 1e-9
    assert math.degrees(turned) / 15 == pytest.approx(round(math.degrees(turned) / 15), abs=1e-9)
    assert (
        Snapping(True).is_active(False) and Snapping().is_active(True) and not Snapping(True).is_active(True)
    )


def test_a_drag_snaps_by_the_switch_or_while_ctrl_is_held(workspace) -> None:
    editor = workspace.editor

    def dragged(**held: bool) -> np.ndarray:
        workspace.input.activate_tool("carry")
        at = pixel_on(workspace, "post")
        workspace.input.press(at, **held)
        workspace.input.move((at[0] + 47.0, at[1] - 13.0), **held)
        workspace.input.release((at[0] + 47.0, at[1] - 13.0), **held)
        editor.select_only("post")
        place = workspace.selection_transform.place
        editor.undo()
        return place / 0.1

    free, held = dragged(), dragged(ctrl=True)
    workspace.actions.do("edit.snap")
    switched, opposite = dragged(), dragged(ctrl=True)
    assert np.allclose(held, np.round(held), atol=1e-3) and np.allclose(switched, held)
    assert not np.allclose(free, np.round(free), atol=1e-2) and np.allclose(free, opposite)


def test_a_bookmark_brings_the_view_back_and_is_in_the_file(workspace, tmp_path) -> None:
    editor = workspace.editor
    assert "F5" in workspace.actions["view.take_1"].why_not()
    editor.camera.orbit(0.7, 0.2)
    editor.camera.zoom(0.6)
    goal = editor.camera.goal
    assert workspace.actions.press("ctrl+f5") and editor.history.names[-1] == "store view 1"
    editor.frame_all()
    assert editor.camera.goal != goal
    assert workspace.actions.press("f5")
    assert editor.camera.goal == pytest.approx(goal)
    write_project(tmp_path / "viewed.enliven", editor.project)
    assert are_identical(read_project(tmp_path / "viewed.enliven").views, editor.project.views)
    editor.undo()
    assert not editor.project.views


@pytest.mark.slow
def test_numbers_are_typed_in_the_window(tmp_path) -> None:
    report = in_a_window(SESSION, str(tmp_path))
    assert report["done"] and report["complaints"] == ["the text is not a number"], report
    assert report["place"] == pytest.approx(1.5, abs=1e-4) and report["tall"] == pytest.approx(0.5, abs=1e-4)
    assert report["steps"] == ["place post", "size of post"], "what is no number changes nothing"
