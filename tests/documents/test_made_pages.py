"""Tests that generated pages are up to date."""

import sys
from datetime import datetime

from blocks import ROOT

sys.path[:0] = [str(ROOT / "scripts"), str(ROOT / "tests" / "benchmarks")]

import figures_page  # noqa: E402
import health_tables  # noqa: E402
import settings_page  # noqa: E402
from figure import Figure  # noqa: E402


def test_tables_of_the_health_page_are_current():
    page = health_tables.PAGE.read_text(encoding="utf-8")
    assert page == health_tables.make_page(page), "run .venv/bin/python scripts/health_tables.py"
    assert page.count("<!-- end -->") == 3 and "| `enliven_edge_up` | gauge | edge |" in page


def test_settings_page_is_current():
    page = settings_page.PAGE.read_text(encoding="utf-8")
    assert page == settings_page.make_page(page), "run .venv/bin/python scripts/settings_page.py"
    assert page.count("<!-- end -->") == len(settings_page.KINDS)
    assert "| `full_rate` | `4` | 1 to 32 |" in page


def test_every_setting_of_a_page_has_a_sentence():
    for line in settings_page.PAGE.read_text(encoding="utf-8").splitlines():
        if line.startswith("| `"):
            assert line.rstrip(" |").endswith((".", ")", "?")), line


def test_figures_page_needs_all_parts_from_one_machine_within_a_day(tmp_path):
    kept, page, parts = tmp_path / "out" / "recent.json", tmp_path / "figures.md", ["arap", "road"]
    page.write_text("before <!-- figures --> old <!-- end --> after", encoding="utf-8")
    evening, morning, machine = datetime(2026, 11, 21, 23), datetime(2026, 11, 22, 8), "two cores"
    late, frame = Figure("road.late", 7.0, "ms"), Figure("arap.frame", 3.6, "ms", "libigl", 7.5)
    recent = figures_page.gather_figures("road", [late], machine, evening, kept)
    assert figures_page.write_when_whole(recent, parts, evening, page) == ["arap"]
    assert " old " in page.read_text()
    recent = figures_page.gather_figures("arap", [frame], machine, morning, kept)
    assert recent == {"road": [late], "arap": [frame]}
    assert figures_page.write_when_whole(recent, parts, morning, page) == []
    assert "| `road.late` | 7 | ms |" in page.read_text() and " old " not in page.read_text()
    night = datetime(2026, 11, 22, 23, 30)
    assert figures_page.gather_figures("arap", [frame], machine, night, kept) == {"arap": [frame]}, "too old"
    assert figures_page.gather_figures("road", [late], "four cores", night, kept) == {"road": [late]}


def test_a_whole_run_of_benchmarks_writes_the_table_of_figures():
    page, evening = figures_page.PAGE.read_text(encoding="utf-8"), datetime(2026, 11, 21, 23)
    figures = [Figure("road.late", 7.125, "ms"), Figure("arap.frame", 3.6, "ms", "libigl", 7.5)]
    once = figures_page.make_page(page, figures, "two cores", evening)
    assert "Measured within 24 hours, until 2026-11-21, on two cores." in once
    rows = [line for line in once.splitlines() if line.startswith(("| `road.late", "| `arap.frame"))]
    assert rows == ["| `arap.frame` | 3.6 | ms | 7.5 | libigl |", "| `road.late` | 7.125 | ms | | |"]
    assert figures_page.make_page(once, figures, "two cores", evening) == once
    fast = Figure("road.latency_p50_ms", 7.1, "ms")
    highlights = figures_page.make_page(page, [fast], "two cores", evening).partition("### All figures")[0]
    assert "| time from reading a frame to publishing the pose, median | 7.1 | ms | | |" in highlights
    before, _, after = page.partition("<!-- figures -->")
    assert once.startswith(before) and once.endswith(after.partition("<!-- end -->")[2])
    assert "cores of" in figures_page.this_machine()
