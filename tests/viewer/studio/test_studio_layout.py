"""Tests of the window from 600x400 to 3840x2160 and with large text: everything is reachable, nothing
overlaps.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from in_a_window import in_a_window

from enliven_viewer.studio.app.workspace_tabs import WORKSPACES
from enliven_viewer.studio.features.paint.paint_tool import PaintTool
from enliven_viewer.studio.tools.registry import TOOLS

pytestmark = pytest.mark.slow

SESSION = Path(__file__).parents[1] / "studio_layout_session.py"
MOST_PIXELS = 3.0
"""Maximum pixels by which a widget may exceed the window, because of rounding."""


@pytest.fixture(scope="module")
def shown(tmp_path_factory) -> dict:
    return in_a_window(SESSION, str(tmp_path_factory.mktemp("layout")), screen="3840x2160x24")


def test_no_letters_are_cut_or_overlap_at_any_size(shown: dict) -> None:
    assert len(shown) == 22
    for name, report in shown.items():
        assert report["letters"] > 100, f"{name}: the letters were not found"
        assert not report["cut"], f"{name}: {report['cut']}"
        assert not report["overlapping"], f"{name}: {report['overlapping']}"


def test_tabs_tools_and_menu_are_inside_the_window_at_any_size(shown: dict) -> None:
    for name, report in shown.items():
        wide, high = report["usual"]
        wanted = [f"room {room}" for room in WORKSPACES]
        if not name.startswith(("Perform", "a scan", "the start page")):
            wanted += [f"tool {kind.name}" for kind in (*TOOLS, PaintTool)]
        for widget in wanted:
            left, top, right, bottom = report["widgets"][widget]
            assert left >= 0 and top >= 0, (name, widget)
            assert right <= wide + MOST_PIXELS and bottom <= high + MOST_PIXELS, (name, widget)
        lines = [report["widgets"][f"room {room}"] for room in WORKSPACES]
        assert all(before[2] <= other[0] + 0.5 for before, other in itertools.pairwise(lines)), name
        menu = max(place[2] for widget, place in report["widgets"].items() if widget.startswith("menu "))
        assert menu <= lines[0][0], f"{name}: the menus and the tabs share pixels"


def test_hint_covers_no_character_and_all_are_in_view(shown: dict) -> None:
    hinted = {name: report for name, report in shown.items() if "hint" in report["widgets"]}
    assert len(hinted) >= 12
    for name, report in hinted.items():
        left, top, right, bottom = report["widgets"]["hint"]
        low_x, low_y, high_x, high_y = report["character"]
        apart = right <= low_x or high_x <= left or bottom <= low_y or high_y <= top
        assert apart, f"{name}: the hint covers what is worked on"


def test_the_start_page_is_inside_the_picture_and_begins_at_its_top(shown: dict) -> None:
    for name in ("the start page 600x400", "the start page 1000x640 at 200 %"):
        report = shown[name]
        left, top, right, bottom = report["widgets"]["start page"]
        low_x, low_y, high_x, high_y = report["picture"]
        assert left >= low_x and top >= low_y and right <= high_x and bottom <= high_y, name
        first = report["widgets"]["do Stand in front of the camera"]
        assert top < first[1] and first[3] < bottom, f"{name}: what one begins with is out of sight"
