"""Tests of the window on high-density screens and with large text: one scale for everything, accessible
colours.
"""

from __future__ import annotations

import ctypes.util
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from in_a_window import in_a_window

from enliven_viewer import theme
from enliven_viewer.studio.app.panel_layout import (
    MENU_HEIGHT,
    MIN_TIMELINE_HEIGHT,
    MIN_VIEW_HEIGHT,
    TIMELINE_HEIGHT,
    lay_out_panels,
)
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.preferences import TEXT_SIZES, Preferences
from enliven_viewer.studio.workspace.workspace import Workspace

SESSION = Path(__file__).parents[1] / "studio_scale_session.py"
ON_X11 = sys.platform.startswith("linux") and ctypes.util.find_library("X11") is not None


@pytest.mark.skipif(not ON_X11, reason="the density is said to an X server")
@pytest.mark.slow
def test_on_a_screen_of_twice_the_density_all_is_twice_as_large_in_its_place(tmp_path) -> None:
    plain, dense, large = (
        in_a_window(SESSION, str(tmp_path / str(k)), *arguments)
        for k, arguments in enumerate(
            (("96", "640", "400", "1.0"), ("192", "640", "400", "1.0"), ("96", "1280", "800", "2.0"))
        )
    )
    assert plain["window"] == [640, 400] and plain["scale"] == 1.0
    for other in (dense, large):
        assert other["window"] == other["picture"] == [1280, 800] and other["scale"] == 2.0
        assert other["usual"] == [640.0, 400.0]
        assert set(other["widgets"]) == set(plain["widgets"])
        for name, place in plain["widgets"].items():
            # Glyph widths are rounded to half a pixel, which adds up along menus.
            np.testing.assert_allclose(other["widgets"][name], place, atol=12.0, err_msg=name)
    for report in (plain, dense, large):
        np.testing.assert_allclose(report["pointer"], report["aimed"], atol=1.0)


@given(st.floats(320, 4096), st.floats(400, 4096), st.booleans(), st.booleans())
def test_a_low_window_leaves_the_picture_its_height_before_the_timeline(
    width, height, puppet, curves
) -> None:
    places = lay_out_panels(width, height, puppet=puppet, curves=curves)
    assert MIN_TIMELINE_HEIGHT <= places.timeline.height <= TIMELINE_HEIGHT
    assert places.viewport.height >= MIN_VIEW_HEIGHT or places.timeline.height == MIN_TIMELINE_HEIGHT
    parts = [places.viewport, *filter(None, (places.strip, places.curves)), places.timeline]
    assert sum(part.height for part in parts) == pytest.approx(height - MENU_HEIGHT, abs=1e-6) or height < 480


def test_text_grows_by_steps_to_twice_its_size_and_is_kept(tmp_path) -> None:
    workspace = Workspace.new(Editor(), tmp_path)
    larger, smaller = "view.larger_text", "view.smaller_text"
    done = [workspace.actions.do(larger) for _ in TEXT_SIZES]
    assert workspace.preferences.text_size == TEXT_SIZES[-1] == 2.0 and not done[-1]
    assert Preferences(tmp_path).text_size == 2.0
    while workspace.actions.do(smaller):
        pass
    assert workspace.preferences.text_size == TEXT_SIZES[0]


def test_with_less_motion_the_view_turns_at_once(tmp_path) -> None:
    workspace = Workspace.new(Editor(), tmp_path)
    editor = workspace.editor
    workspace.actions.do("view.less_motion")
    workspace.actions.do("view.right")
    editor.advance(1e-4)
    turned = editor.lens.forward
    editor.advance(10.0)
    np.testing.assert_allclose(editor.lens.forward, turned, atol=1e-9)
    workspace.actions.do("view.less_motion")
    workspace.actions.do("view.front")
    editor.advance(1e-4)
    assert math.degrees(np.arccos(np.clip(editor.lens.forward @ turned, -1, 1))) < 5.0, "it glides"


SEEN = {
    "without red": "0.152 1.053 -0.205  0.115 0.786 0.099  -0.004 -0.048 1.052",
    "without green": "0.367 0.861 -0.228  0.280 0.673 0.047  -0.012 0.043 0.969",
    "without blue": "1.256 -0.077 -0.179  -0.078 0.931 0.148  0.005 0.691 0.304",
    "with all": "1 0 0  0 1 0  0 0 1",
}
"""Matrices from linear RGB to linear RGB as seen without one kind of cone (Machado, Oliveira and Fernandes
2009).
"""


@pytest.mark.parametrize("eyes", SEEN)
def test_status_colours_differ_for_all_eyes(eyes: str) -> None:
    matrix = np.array(SEEN[eyes].split(), float).reshape(3, 3)
    shades = [lab(matrix @ linear(colour[:3])) for colour in (theme.GOOD, theme.WAIT, theme.BAD)]
    for k, colour in enumerate(shades):
        for other in shades[k + 1 :]:
            assert np.linalg.norm(colour - other) > 25.0, "ten times what is just noticed"


def linear(colour: tuple[float, ...]) -> np.ndarray:
    """Returns the linear RGB of sRGB."""
    value = np.array(colour)
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    """Returns the CIE L*a*b* of linear RGB, for daylight."""
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    ratio = xyz @ np.clip(rgb, 0, 1) / [0.9505, 1.0, 1.089]
    f = np.where(ratio > 0.008856, np.cbrt(ratio), 7.787 * ratio + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])
